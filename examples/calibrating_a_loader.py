# %% [markdown]
# # Calibrating a loader from readings
#
# Someone holds the column at some deflections and gradients, reads a ruler and a spring scale,
# and notes the two voltages of the loader's own sensors. From that come the scales S1 and S3 and
# the bend K of the structure, each with its error. Here the readings are taken on a rig whose
# true values are known, with the errors of usual instruments.

# %%
import coupled
from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.calibrated import with_calibration
from coupled.calibration.estimate import usual_instruments
from coupled.calibration.plan import precision, stations

rig = coupled.load_rig("report-column").changed(
    {
        "controls.column.sensing.computed_scale": 0.96,  # S1 is 4 % less than the host assumes
        "controls.column.compensation.bend_m_per_N": 0.0,  # and the host knows of no bend
    }
)
tools = usual_instruments("column")

# %% [markdown]
# Which readings, and how well will they tell K? The plan takes a usual K, as none is known yet.

# %%
grid = stations(rig, "column", 4, 4)
print(f"{len(grid)} readings: K to ±{100 * precision(rig, 'column', grid, tools).half_width:.0f} %")

# %%
readings = take_readings(CalibrationBench(rig, "column", grid, tools), seed=1)
found = coupled.calibrate(readings, rig)
true = rig.controls["column"].loader.bend
bend = found.line.bend
print(
    f"K = {1e3 * bend.value:.4f} mm/N, 95 % interval {1e3 * bend.low:.4f} to {1e3 * bend.high:.4f}"
)
print(f"true: {1e3 * true:.4f} mm/N")

# %% [markdown]
# A host that uses the calibration gives the authority back.

# %%
calibrated = with_calibration(rig, "column", found)
pull = coupled.Clamp(deflection_m=0.04, start_s=0.5)
for name, each in (("before", rig), ("after", calibrated)):
    flight = coupled.fly(each, column=pull, duration_s=5, configuration="compensated")
    print(f"{name:7} {100 * flight.outcome.loss:5.1f} % of the elevator lost")

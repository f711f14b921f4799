# %% [markdown]
# # Calibrating a loader from readings
#
# Someone holds the column at some deflections and gradients, reads a ruler and a spring scale,
# and notes the two voltages of the loader's own sensors. From that come the scales S1 and S3 and
# the bend K of the structure, each with its error. Here the readings are taken on a rig whose
# true values are known, with the errors of usual instruments.

# %%
import argparse

import coupled

about = argparse.ArgumentParser(
    description="Takes readings on a virtual loader, finds S1, S3 and K from them, and flies both."
)
about.parse_known_args()  # for --help

rig = coupled.load_rig("report-column").changed(
    {
        "controls.column.sensing.computed_scale": 0.96,  # S1 is 4 % less than the host assumes
        "controls.column.compensation.bend_m_per_N": 0.0,  # and the host knows of no bend
    }
)

# %% [markdown]
# Which readings, and how well will they tell K? The plan takes a usual K, as none is known yet.

# %%
print(coupled.plan(rig))

# %%
found = coupled.calibrate(coupled.bench(rig, gradients=4, deflections=4, seed=1), rig)
true, bend = rig["controls.column.loader.bend_m_per_N"], found.line.bend
print(found)
print(f"true: {true:.4g} m/N")

# %% [markdown]
# A host that uses the calibration gives the authority back.

# %%
calibrated = coupled.with_calibration(rig, "column", found)
pull = coupled.Clamp(deflection_m=0.04, start_s=0.5)
before, after = (
    coupled.fly(each, column=pull, duration_s=5, configuration="compensated")
    for each in (rig, calibrated)
)
print("before:", before)
print("after: ", after)

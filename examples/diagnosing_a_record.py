# %% [markdown]
# # From a record to an improved rig
#
# A record of the real rig and a simulation of it part ways. Where, by which effect, and how large
# is it? Here the real rig is one that we wear out ourselves, so that the answer is known.

# %%
import argparse

import coupled

about = argparse.ArgumentParser(
    description="Wears out a rig, flies it, and finds from the record by which effect."
)
about.parse_known_args()  # for --help

nominal = coupled.load_rig("t37")
real = nominal.changed({"controls.column.loader.damping_N_s_per_m": 110.0, "noise": {}})
print("nominal damping:", nominal["controls.column.loader.damping_N_s_per_m"], "N s/m")

# %% [markdown]
# A frequency sweep moves the column from its static feel to its dynamics.

# %%
sweep = coupled.FrequencySweep(force_N=40, start_s=0.5, duration_s=10, low_Hz=0.1, high_Hz=2.5)
record = coupled.fly(real, column=sweep, duration_s=12, seed=5).record
print(record)

# %%
found = coupled.diagnose(nominal, record)
print(found)
print(found.to_polars().select("key", "filed", "found", "low", "high"))

# %% [markdown]
# The improved rig flies as the record does; `found.improved.save("improved.toml")` keeps it, with
# the comments of the rig file.

# %%
for name, rig in (("nominal", nominal), ("improved", found.improved)):
    again = coupled.fly(rig, column=sweep, duration_s=12, seed=5).record
    off = abs(again["column_deflection_m"] - record["column_deflection_m"]).max()
    print(f"{name:9} differs by up to {1e3 * off:.3f} mm of column")

# %%
figure = record.plot("column_force_N", "column_deflection_m", "load_factor")

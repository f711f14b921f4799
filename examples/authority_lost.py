# %% [markdown]
# # What a bending column takes from a 737
#
# A control loader measures where its own motor stands. The structure between motor and grip
# bends under the pilot's pull, so the host moves the elevator less than the pilot asks for, and
# the feel is softer than specified. Both grow with the gradient, and so with dynamic pressure.

# %%
import argparse

import coupled

about = argparse.ArgumentParser(
    description="What a bending column takes from a 737: compares a held pull with each correction."
)
about.parse_known_args()  # for --help

rig = coupled.load_rig("737")
for key in ("loader.bend_m_per_N", "travel_m"):
    print(key, "=", rig[f"controls.column.{key}"])

# %% [markdown]
# The same pull, held at 6 cm, on a rigid structure, on the one that bends, and with each of the
# host's two corrections. `Clamp` holds the grip; the force is what that takes. A notebook shows
# the table with its figure.

# %%
pull = coupled.Clamp(deflection_m=0.06, start_s=0.5)
table = coupled.compare(rig, column=pull, duration_s=4)
print(table)

# %% [markdown]
# The closed form of the rig's statics agrees to what friction adds, which it leaves out. The
# aircraft shows the loss: less elevator is less pitch rate.

# %%
bent, rigid = table.flight("uncompensated").outcome, table.flight("rigid").outcome
print(f"uncompensated, by the closed form: {100 * bent.loss_closed_form:.1f} % lost")
if bent.peak_rate_rad_per_s is not None and rigid.peak_rate_rad_per_s is not None:
    share = bent.peak_rate_rad_per_s / rigid.peak_rate_rad_per_s
    print(f"peak pitch rate is {100 * share:.0f} % of that with a rigid structure")

# %%
figure = table.flight("uncompensated").record.plot(
    "column_force_N", "column_deflection_m", "column_estimate_m", "pitch_rate_rad_per_s"
)
frame = table.to_polars().select("configuration", "loss", "felt_ratio", "peak_load_factor")

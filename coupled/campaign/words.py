"""A verdict's figure, bounds and margin in words."""

from __future__ import annotations

from coupled.campaign.verdict import Verdict


def wanted(verdict: Verdict) -> str:
    """Return the bounds, as `0.2 to 0.3`, `≥ 0.2` or `≤ 0.3`."""
    least, most = verdict.least, verdict.most
    if least is not None and most is not None:
        return f"{least:.4g} to {most:.4g}"
    if least is not None:
        return f"≥ {least:.4g}"
    return "" if most is None else f"≤ {most:.4g}"


def finding(verdict: Verdict) -> str:
    """Return what was found, in one line."""
    bounds = f" (wanted {wanted(verdict)})" if wanted(verdict) else ""
    if verdict.value is None or verdict.margin is None:
        return verdict.problem + bounds
    return f"{verdict.value:.6g}{bounds}, margin {verdict.margin:.3g}"

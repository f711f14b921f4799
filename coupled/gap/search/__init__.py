"""The search: which effects, fitted as physics, the stages' residuals call for."""

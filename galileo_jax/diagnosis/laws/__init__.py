"""Laws from data: short formulas that an inferred missing force suggests, fitted in the model."""

"""From measurements to an ErrorModel: one estimator, many observations, learned residuals."""

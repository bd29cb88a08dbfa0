# Formats and analytic models.

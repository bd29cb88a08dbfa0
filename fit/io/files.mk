# Formats and analytic models.
unit-y += tests/unit/test_metrics.c tests/unit/test_analytic.c tests/unit/test_plan.c

# Samples -> model.
eval-y += fit/model.c
lib-y  += fit/resolve.c fit/metrics.c fit/analytic.c fit/lobes.c fit/spec.c

# Samples -> model.
eval-y += fit/model.c fit/lattice.c fit/lattice_eval.c fit/lattice_model.c fit/model_file.c
lib-y  += fit/resolve.c fit/metrics.c fit/analytic.c fit/lobes.c fit/spec.c
lib-y  += fit/scatter.c fit/scatter_sort.c fit/team.c fit/mba.c fit/mba_kernel.c fit/mba_method.c fit/choose.c fit/methods.c fit/fit.c fit/stream.c

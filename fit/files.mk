# Samples -> model.
eval-y += fit/model.c fit/channels.c fit/lattice.c fit/lattice_eval.c fit/lattice_model.c fit/model_file.c
eval-y += fit/mph.c fit/sparse.c fit/cbmba_model.c
lib-y  += fit/resolve.c fit/metrics.c fit/spec.c fit/check.c
lib-y  += fit/rank.c fit/scatter.c fit/scatter_sort.c fit/team.c fit/mba.c fit/mba_level.c fit/mba_coarse.c fit/mba_fine.c fit/memory.c fit/mba_kernel.c fit/mba_channels.c fit/mba_method.c fit/choose.c fit/methods.c fit/fit.c fit/stream.c
lib-y  += fit/cbmba.c fit/cbmba_hash.c fit/cbmba_method.c
pkgs-y += cmph
deps-y += libcmph-dev
# Accurate fits: least squares, lobes below the spline, the choice between them.
eval-y += fit/analytic.c fit/lobes.c fit/lobe_model.c
lib-y  += fit/lsq_blas.c fit/lsq_data.c fit/lsq_axis.c fit/lsq_profile.c fit/lsq_dense.c fit/lsq_spread.c fit/lsq_select.c fit/lsq_apply.c fit/lsq_cg.c fit/lsq_precondition.c fit/lsq_penalty.c fit/lsq_inner.c fit/lsq_search.c fit/lsq_large.c fit/lobe_fit.c fit/auto_choose.c fit/auto_describe.c fit/auto_cost.c fit/auto_method.c
lib-y  += fit/uncertainty.c fit/uncertainty_field.c fit/uncertainty_large.c fit/uncertainty_blocks.c fit/uncertainty_law.c fit/lobe_method.c fit/tradeoff.c
pkgs-y += openblas lapacke cminpack
deps-y += libopenblas-dev liblapacke-dev libcminpack-dev
unit-y += tests/unit/test_rank.c tests/unit/test_lsq.c tests/unit/test_lobe_model.c tests/property/test_extrapolation.c
unit-y += tests/unit/test_uncertainty.c tests/unit/test_lsq_profile.c tests/unit/test_lsq_large.c
bench-y += tests/bench/bench_accuracy.c tests/bench/fit_coverage.c
# Long: not among bench-y.
.PHONY: fifty-million
fifty-million: $(B)/tests/bench/fifty_million ## stream 50 million samples into a fit: memory, time, error
	$(Q)$<
$(B)/tests/bench/fifty_million: $(B)/tests/bench/fifty_million.o $(B)/libgonio.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< $(B)/libgonio.a $(PKG_LIBS)

# One file an analytic formula, each with a line in formulae.def.
eval-y += $(patsubst %,brdf/analytic/%.c,geometry formulae spec lambert ward blinn_phong cook_torrance ggx oren_nayar)

cli-y  += host/cli/main.c host/cli/options.c host/cli/report.c host/cli/progress.c
pkgs-y += jansson
deps-y += build-essential pkg-config libjansson-dev libcmocka-dev
cli-y  += host/cli/cmd_render.c
cli-y  += host/cli/input.c host/cli/cmd_fit.c host/cli/cmd_eval.c host/cli/cmd_compare.c host/cli/cmd_convert.c

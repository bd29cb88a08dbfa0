# Samples -> model.
eval-y += fit/model.c
lib-y  += fit/resolve.c

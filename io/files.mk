# BRDF files in and out: one file a format.
lib-y += $(call sources,io)

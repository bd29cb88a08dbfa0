# The simulated rig.
lib-y += $(call sources,sim)

# SPDX-License-Identifier: BSD-3-Clause
# The commit that is built, where the source is a repository: sessions keep it. hosts.c alone is compiled anew for it.
COMMIT := $(shell git --git-dir=.git --work-tree=. describe --always --dirty --abbrev=12 --exclude='*' 2>/dev/null)
CFLAGS_hosts := -DGONIO_COMMIT='"$(COMMIT)"'
$(shell mkdir -p $(B) && echo '$(COMMIT)' | cmp -s - $(B)/commit || echo '$(COMMIT)' > $(B)/commit)
$(B)/host/session/hosts.o: $(B)/commit

# The journal (SQLite) and the frame store (PNG), hashes (libcrypto).
lib-y  += host/session/database.c host/session/session.c host/session/settings.c host/session/steps.c
lib-y  += host/session/frames.c host/session/frame_file.c host/session/samples.c host/session/hash.c host/session/hash_samples.c
lib-y  += host/session/store.c host/session/compress.c host/session/burst.c
lib-y  += host/session/doctor.c host/session/salvage.c
unit-y += tests/unit/test_session.c tests/unit/test_burst.c
bench-y += tests/bench/capture_throughput.c
pkgs-y += sqlite3 libpng libcrypto
deps-y += libsqlite3-dev libpng-dev libssl-dev

# rqt: `make help` lists every door.
#
# Objects are compiled twice where they speak SQL: as part of a host's process (rqt.so, through the host's SQLite) and as
# part of our own command (linked to SQLite). Everything else once, position-independent.

BUILD ?= build
CC = gcc
CXX = g++
OPTIMIZE ?= -O3
WARNINGS = -Wall -Wextra -Wconversion -Wshadow -Werror
SANITIZE ?=
# No fused multiply-adds: the same input gives the same bytes on every machine.
CFLAGS += -std=gnu11 -g $(OPTIMIZE) $(WARNINGS) -fPIC -ffp-contract=off -fvisibility=hidden -MMD -MP $(SANITIZE)
CXXFLAGS += -std=c++17 -g $(OPTIMIZE) $(WARNINGS) -fPIC -ffp-contract=off -fvisibility=hidden -MMD -MP $(SANITIZE)
INCLUDES = -Isrc/core -Isrc/store -Isrc/geo -Isrc/verify -Isrc/format -Isrc/import -Isrc/text -Isrc/picture -Isrc/tiles -Isrc/serve -Iext -I$(BUILD)/generated

CORE = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/core/*.c))
PLAIN = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/verify/*.c src/format/*.c))
GEO = $(patsubst src/%.cpp,$(BUILD)/%.o,$(wildcard src/geo/*.cpp))
SQL_SOURCES = $(wildcard src/store/*.c ext/*.c)
SQL_HOSTED = $(patsubst %.c,$(BUILD)/hosted/%.o,$(SQL_SOURCES))
SQL_LINKED = $(patsubst %.c,$(BUILD)/linked/%.o,$(SQL_SOURCES))
IMPORT = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/import/*.c))
PICTURE = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/picture/*.c src/text/*.c))
TILES = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/tiles/*.c src/tiles/*/*.c))
SERVE = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/serve/*.c)) $(BUILD)/generated/web_files.o
CLI = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/cli/*.c))
# What the query service has in it: its pages, and what it says of itself. The pages are the same in every build.
WEB = build/web
VIEWER_FILES = $(addprefix $(WEB)/,index.html viewer.css viewer.js decoder.js)
CESIUM_FILES = $(addprefix $(WEB)/,cesium.html cesium.css cesium.js cesium-licence.md $(CESIUM_WORKERS:%=%.js))
CESIUM_WORKERS = createVerticesFromQuantizedTerrainMesh upsampleQuantizedTerrainMesh incrementallyBuildTerrainPicker transferTypedArrayTest
WEB_FILES = $(VIEWER_FILES) $(CESIUM_FILES) src/serve/openapi.json
GENERATED = $(BUILD)/generated/schema_sql.h

LIBS_CORE = -lzstd -lm
LIBS_EXT = -lGeographicLib -lgeos_c -lproj -lcjson $(LIBS_CORE)
LIBS_CLI = $(LIBS_EXT) -lsqlite3 $(shell gdal-config --libs 2>/dev/null) $(shell pkg-config --libs cairo libpng 2>/dev/null) -lmicrohttpd -ldeflate -lz -lpthread -lstdc++
GDAL_CFLAGS = $(shell gdal-config --cflags 2>/dev/null)
CAIRO_CFLAGS = $(shell pkg-config --cflags cairo libpng 2>/dev/null)

.PHONY: all
all: ## build the command and the extension: build/rqt and build/rqt.so
	@./src/install-packages.sh build
	@./src/install-packages.sh web || echo "No node and npm: rqt serve goes without its viewer" >&2
	@$(MAKE) --no-print-directory -j2 products
	@echo "$(BUILD)/rqt and $(BUILD)/rqt.so are ready"

.PHONY: products
products: $(BUILD)/rqt $(BUILD)/rqt.so
	@:

$(BUILD)/librqt.a: $(CORE)
	@rm -f $@
	@echo "  archive $@"; ar rcs $@ $^

$(BUILD)/rqt.so: $(SQL_HOSTED) $(PLAIN) $(GEO) $(BUILD)/librqt.a ext/exports.map
	@echo "  link $@"; $(CXX) $(SANITIZE) -shared -Wl,--version-script=ext/exports.map -Wl,-z,defs -o $@ $(SQL_HOSTED) $(PLAIN) $(GEO) $(BUILD)/librqt.a $(LIBS_EXT)

$(BUILD)/rqt: $(CLI) $(SERVE) $(TILES) $(PICTURE) $(SQL_LINKED) $(IMPORT) $(PLAIN) $(GEO) $(BUILD)/librqt.a
	@echo "  link $@"; $(CXX) $(SANITIZE) -o $@ $^ $(LIBS_CLI)

$(BUILD)/hosted/%.o: %.c $(GENERATED)
	@mkdir -p $(@D)
	@echo "  compile $< (for rqt.so)"; $(CC) $(CFLAGS) $(INCLUDES) -c $< -o $@
$(BUILD)/linked/%.o: %.c $(GENERATED)
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -DSQLITE_CORE -c $< -o $@
$(BUILD)/import/%.o: src/import/%.c
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -DSQLITE_CORE $(GDAL_CFLAGS) -c $< -o $@
$(BUILD)/text/%.o: src/text/%.c
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -DSQLITE_CORE -c $< -o $@
$(BUILD)/picture/%.o: src/picture/%.c
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -DSQLITE_CORE $(CAIRO_CFLAGS) -c $< -o $@
$(BUILD)/tiles/%.o: src/tiles/%.c
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -DSQLITE_CORE -c $< -o $@
$(BUILD)/serve/%.o: src/serve/%.c
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -DSQLITE_CORE -c $< -o $@
$(WEB)/viewer.js: $(wildcard src/web/*) src/web/.npmrc
	@echo "  bundle $@"; ./src/web/bundle.sh $(WEB) build/web-packages
$(filter-out $(WEB)/viewer.js,$(VIEWER_FILES)): $(WEB)/viewer.js ;
$(WEB)/cesium.js: $(wildcard src/web/cesium/*) src/web/cesium/.npmrc src/web/format.js src/web/ramps.js src/web/service.js src/web/without.js
	@echo "  bundle $@"; ./src/web/cesium/bundle.sh $(WEB) build/cesium-packages $(CESIUM_WORKERS)
$(filter-out $(WEB)/cesium.js,$(CESIUM_FILES)): $(WEB)/cesium.js ;
$(BUILD)/generated/web_files.c: src/serve/embed.sh $(WEB_FILES)
	@mkdir -p $(@D)
	@./src/serve/embed.sh $(@D)/web $(WEB_FILES) > $@
$(BUILD)/generated/web_files.o: $(BUILD)/generated/web_files.c
	@$(CC) $(CFLAGS) $(INCLUDES) -c $< -o $@
$(BUILD)/cli/%.o: src/cli/%.c $(GENERATED)
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -DSQLITE_CORE $(CAIRO_CFLAGS) -c $< -o $@
$(BUILD)/geo/%.o: src/geo/%.cpp
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CXX) $(CXXFLAGS) $(INCLUDES) -c $< -o $@
$(BUILD)/%.o: src/%.c
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -c $< -o $@

# Its vectors never cross a call.
$(BUILD)/core/error_kernels.o: WARNINGS += -Wno-psabi

# The SQL that a person can read is the SQL that the program runs.
$(BUILD)/generated/schema_sql.h: sql/schema.sql sql/terrain.sql sql/fill.sql sql/geopackage.sql
	@mkdir -p $(@D)
	@for f in schema terrain fill geopackage; do \
	  printf '__attribute__((unused)) static const char sql_%s[] =\n' $$f; \
	  sed -e '/^--/d' -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/^/    "/' -e 's/$$/\\n"/' sql/$$f.sql; printf '    ;\n'; \
	done > $@

# ------------------------------------------------------------------------------------------------------- demo
.PHONY: demo
demo: all ## import a real DEM and show what rqt does with it; pictures in build/demo
	@BUILD=$(BUILD) ./examples/demo.sh

PORT ?= 8080
.PHONY: serve-demo
serve-demo: all ## the query service and its page on the demo's terrain, at http://127.0.0.1:8080/ (PORT=0: where it is free)
	@[ -e $(BUILD)/demo/white-mountains.gpkg ] || $(MAKE) --no-print-directory demo
	@$(BUILD)/rqt serve --port $(PORT) $(BUILD)/demo/white-mountains.gpkg

# ------------------------------------------------------------------------------------------------------ tests
# Everything that a test may want of us in one archive; the linker takes what each one needs.
TEST_PROGRAMS = $(patsubst tests/%.c,$(BUILD)/tests/%,$(wildcard tests/test_*.c))
TEST_PARTS = $(BUILD)/tests/oracle.o $(SQL_LINKED) $(TILES) $(IMPORT) $(PLAIN) $(GEO)
LIBS_TEST = -lcmocka -lgmp -lproj $(LIBS_CLI)

$(BUILD)/tests/oracle.o: tests/oracle.c
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) -c $< -o $@
$(BUILD)/tests/libtest.a: $(TEST_PARTS) $(CORE)
	@rm -f $@
	@ar rcs $@ $^
$(BUILD)/tests/test_%.o: tests/test_%.c $(GENERATED)
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -Itests -DSQLITE_CORE $(GDAL_CFLAGS) -c $< -o $@
$(BUILD)/tests/test_%: $(BUILD)/tests/test_%.o $(BUILD)/tests/libtest.a
	@$(CXX) $(SANITIZE) $(LINK_TEST) -o $@ $^ $(LIBS_TEST)
# The judge of tiles is linked to nothing of ours.
JUDGE_OF_TILES = $(patsubst %.cpp,$(BUILD)/%.o,$(wildcard tests/verify_tiles*.cpp))
$(JUDGE_OF_TILES): $(BUILD)/%.o: %.cpp
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CXX) $(CXXFLAGS) $(GDAL_CFLAGS) -c $< -o $@
$(BUILD)/tests/verify_tiles: $(JUDGE_OF_TILES)
	@$(CXX) $(SANITIZE) -o $@ $^ $(shell gdal-config --libs 2>/dev/null) -lGeographicLib -lcjson
# The C decoder's answers, beside which the page's are put.
$(BUILD)/tests/web/decode: tests/web/decode.c $(BUILD)/librqt.a
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -o $@ $^ $(LIBS_CORE)
# Its own malloc stands before ours, and can say no.
$(BUILD)/tests/test_fault_memory: LINK_TEST = -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc

# Fuzzers are linked to a driver of their own for the tests, to libFuzzer for `make fuzz`.
FUZZERS = $(patsubst tests/fuzz/%.c,%,$(wildcard tests/fuzz/fuzz_*.c))
FUZZ_DRIVER = $(BUILD)/tests/fuzz/driver.o
$(BUILD)/tests/fuzz/%.o: tests/fuzz/%.c $(GENERATED)
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -DSQLITE_CORE -c $< -o $@
$(BUILD)/tests/fuzz/fuzz_%: $(BUILD)/tests/fuzz/fuzz_%.o $(FUZZ_DRIVER) $(BUILD)/tests/libtest.a
	@$(CXX) $(SANITIZE) $(LINK_FUZZ) -o $@ $^ $(LIBS_TEST)

.PHONY: test-programs fuzz-programs test test-quick
test-programs: $(TEST_PROGRAMS)
	@:
fuzz-programs: $(FUZZERS:%=$(BUILD)/tests/fuzz/%)
	@:

test: ## install, build, and pass every test (also under ASan and UBSan)
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products test-programs $(BUILD)/tests/verify_tiles
	@$(MAKE) --no-print-directory -j2 BUILD=$(BUILD)/sanitized OPTIMIZE=-O1 \
	  SANITIZE="-fsanitize=address,undefined -fno-sanitize-recover=undefined" test-programs fuzz-programs
	@BUILD=$(BUILD) ./tests/run.sh

test-quick: ## the tests without the sanitized build
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products test-programs $(BUILD)/tests/verify_tiles
	@BUILD=$(BUILD) ./tests/run.sh quick

.PHONY: test-qgis
test-qgis: ## install QGIS, and open and draw in it, without a screen, what rqt writes: pictures in build/qgis
	@./src/install-packages.sh build test qgis
	@$(MAKE) --no-print-directory -j2 products
	@RQT=$(BUILD)/rqt RQT_SO=$(BUILD)/rqt.so /usr/bin/python3 tests/qgis/test_qgis.py $(BUILD)/qgis

# The test programs alone, which know the core best: what only a script reaches counts as missed.
.PHONY: coverage
coverage: ## the test programs in a build that counts: the core's lines, 100 % but for those of tests/coverage.txt
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 BUILD=$(BUILD)/coverage OPTIMIZE=-O1 WARNINGS=-w SANITIZE=--coverage test-programs
	@find $(BUILD)/coverage -name '*.gcda' -delete
	@BUILD=$(BUILD)/coverage PROGRAMS="$(notdir $(TEST_PROGRAMS))" ./tests/run.sh programs
	@/usr/bin/python3 tests/coverage.py $(BUILD)/coverage

# What runs on several threads: readers beside a writer, the import's reader and workers, which work on sweeps and builds;
# and the query service's workers.
THREADED = test_fault_threads
.PHONY: test-threads test-serve test-tiles test-web
test-threads: ## what runs on several threads, under ThreadSanitizer
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@$(MAKE) --no-print-directory -j2 BUILD=$(BUILD)/threads OPTIMIZE=-O1 WARNINGS=-w SANITIZE=-fsanitize=thread $(THREADED:%=$(BUILD)/threads/tests/%) $(BUILD)/threads/rqt
	@BUILD=$(BUILD)/threads PROGRAMS="$(THREADED)" ./tests/run.sh programs
	@export TSAN_OPTIONS=suppressions=$(CURDIR)/tests/threads.supp RQT_HOSTILE_MIB=1024 RQT=$(CURDIR)/$(BUILD)/threads/rqt RQT_SO=$(CURDIR)/$(BUILD)/rqt.so; \
	log=$(BUILD)/threads/test_tiles3d.log; ./tests/test_tiles3d.sh >$$log 2>&1 || { tail -n 60 $$log; exit 1; }; tail -n 1 $$log; ./tests/test_serve.sh quiet

test-serve: ## the query service's tests, plain and under ASan and UBSan
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@$(MAKE) --no-print-directory -j2 BUILD=$(BUILD)/sanitized OPTIMIZE=-O1 \
	  SANITIZE="-fsanitize=address,undefined -fno-sanitize-recover=undefined" $(BUILD)/sanitized/rqt
	@RQT=$(CURDIR)/$(BUILD)/rqt RQT_SO=$(CURDIR)/$(BUILD)/rqt.so ./tests/test_serve.sh quiet
	@ASAN_OPTIONS=detect_leaks=1 LSAN_OPTIONS=suppressions=$(CURDIR)/tests/leaks.supp:print_suppressions=0 RQT_HOSTILE_MIB=1024 RQT=$(CURDIR)/$(BUILD)/sanitized/rqt RQT_SO=$(CURDIR)/$(BUILD)/rqt.so ./tests/test_serve.sh quiet

test-tiles: ## the tests of tiles for globes and maps under ASan and UBSan
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@$(MAKE) --no-print-directory -j2 BUILD=$(BUILD)/sanitized OPTIMIZE=-O1 \
	  SANITIZE="-fsanitize=address,undefined -fno-sanitize-recover=undefined" $(BUILD)/sanitized/rqt
	@export ASAN_OPTIONS=detect_leaks=1 LSAN_OPTIONS=suppressions=$(CURDIR)/tests/leaks.supp:print_suppressions=0 RQT=$(CURDIR)/$(BUILD)/sanitized/rqt RQT_SO=$(CURDIR)/$(BUILD)/rqt.so; \
	for kind in tiles tiles_folder tiles3d terrarium; do log=$(BUILD)/sanitized/test_$$kind.log; ./tests/test_$$kind.sh >$$log 2>&1 || { tail -n 60 $$log; exit 1; }; tail -n 1 $$log; done

test-web: ## the page in headless Chromium, and its modules in node; pictures in build/web-shots
	@./src/install-packages.sh build test web browser
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/web/run.sh

# clang's libFuzzer steers by what code an input reaches; what it finds stays in build/fuzz/NAME.
SECONDS ?= 60
.PHONY: fuzz
fuzz: ## every fuzzer for SECONDS=60 each, steered by libFuzzer, under ASan and UBSan
	@./src/install-packages.sh build test fuzz
	@$(MAKE) --no-print-directory -j2 BUILD=$(BUILD)/fuzz CC=clang-14 CXX=clang++-14 OPTIMIZE=-O1 WARNINGS=-w FUZZ_DRIVER= LINK_FUZZ=-fsanitize=fuzzer \
	  SANITIZE="-fsanitize=address,undefined,fuzzer-no-link -fno-sanitize-recover=undefined" fuzz-programs
	@BUILD=$(BUILD) ./tests/fuzz/run.sh $(SECONDS) $(FUZZERS)

.PHONY: mutants
mutants: ## break the code in one line, many times over: each time a named test must go red
	@./src/install-packages.sh build test web browser
	@$(MAKE) --no-print-directory -j2 products test-programs $(BUILD)/tests/verify_tiles
	@./tests/web/install.sh
	@/usr/bin/python3 tests/mutants.py $(BUILD)

DATA ?= tests/data
.PHONY: verify-data
verify-data: ## rqt_verify over every DEM of DATA=dir at nine eps
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/bench/verify_data.sh $(DATA)

.PHONY: verify-views
verify-views: ## rqt_view_verify over 200 cameras on every DEM of DATA=dir, and every test of options.test: tables
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@RQT=$(BUILD)/rqt RQT_SO=$(BUILD)/rqt.so /usr/bin/python3 tests/bench/verify_views.py $(DATA)

.PHONY: verify-tiles
verify-tiles: ## every tile of every level of every DEM of DATA=dir (KIND=3d-tiles: only those), decoded, beside the raster at every sample; the service too: tables
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products $(BUILD)/tests/verify_tiles
	@BUILD=$(BUILD) RQT=$(BUILD)/rqt RQT_SO=$(BUILD)/rqt.so /usr/bin/python3 tests/verify_tiles.py $(DATA)

.PHONY: check-layers
check-layers: ## modules depend one way only; librqt.a and rqt.so mention only what they may
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/check_layers.sh

FORMATTED = $(wildcard src/*/*.[ch] src/tiles/*/*.[ch] src/geo/*.cpp ext/*.[ch] tests/*.[ch] tests/*.cpp tests/web/*.[ch] tests/fuzz/*.[ch] tests/bench/*.[ch] tests/bench/peers/*.[ch])
.PHONY: format check-format
format: ## lay the sources out (clang-format)
	@./src/install-packages.sh format
	clang-format -i $(FORMATTED)
check-format: ## fail when a source is not laid out
	@./src/install-packages.sh format
	@clang-format --dry-run -Werror $(FORMATTED) && echo "layout: all of $(words $(FORMATTED)) files"

.PHONY: lint
lint: ## clang-tidy and cppcheck: no finding
	@./src/install-packages.sh build lint
	@$(MAKE) --silent --no-print-directory $(GENERATED)
	@BUILD=$(BUILD) FLAGS="$(INCLUDES) -DSQLITE_CORE $(GDAL_CFLAGS) $(CAIRO_CFLAGS)" ./tests/lint.sh

.PHONY: docs check-docs
docs: products ## write ext/SQL.md from the function table
	@./tests/sql_reference.sh $(BUILD) > ext/SQL.md
check-docs: ## fail when ext/SQL.md, the README's session or the list of fuzzers are not what the program says
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@./tests/sql_reference.sh $(BUILD) | diff -u ext/SQL.md - && echo "ext/SQL.md is what the function table says"
	@BUILD=$(BUILD) ./tests/check_readme.sh
	@./tests/check_fuzz.sh

# ---------------------------------------------------------------------------------------------------- benches
.PHONY: bench bench-data bench-update bench-table1 bench-serve bench-tiles bench-views chart chart-views peers
bench: ## speed and size beside GDAL's, medians of five and more
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/bench/bench.sh
bench-data: ## real DEMs of DATA=dir: database beside COG, bits of every part, the wire format
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/bench/bench_data.sh $(DATA)
bench-update: ## what an update of 64 x 64 samples costs in a copy of DATABASE=file
	@$(MAKE) --no-print-directory -j2 products $(BUILD)/tests/libtest.a
	@mkdir -p $(BUILD)/bench && cp "$(DATABASE)" $(BUILD)/bench/update.gpkg
	@$(CC) -std=gnu11 -O3 -DSQLITE_CORE $(WARNINGS) -Isrc/core -Isrc/store tests/bench/bench_update.c -o $(BUILD)/bench/bench_update $(BUILD)/tests/libtest.a $(LIBS_EXT) -lsqlite3 -lstdc++
	@$(BUILD)/bench/bench_update $(BUILD)/bench/update.gpkg; rm -f $(BUILD)/bench/update.gpkg
bench-table1: ## share of vertices over eps beside the paper's table 1
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/bench/bench_table1.sh

bench-serve: ## the query service under wrk, beside nginx that sends the same bytes
	@./src/install-packages.sh build bench
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/bench/bench_serve.sh
bench-tiles: ## tiles for globes: a pyramid of 4097 x 4097 written, and tiles asked of the service
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@RQT=$(BUILD)/rqt RQT_SO=$(BUILD)/rqt.so /usr/bin/python3 tests/bench/bench_tiles.py
	@RQT=$(BUILD)/rqt RQT_SO=$(BUILD)/rqt.so /usr/bin/python3 tests/bench/bench_tiles3d.py
bench-views: ## what views cost: one megapixel, fly-overs, ETOPO5 over a network, beside the papers' figures
	@./src/install-packages.sh build test
	@./src/install-packages.sh views || echo "No ETOPO5: the table goes without" >&2
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/bench/bench_views.sh

# What published methods give on the catalogue's inputs (tests/catalogue.txt), beside rqt.
.PHONY: stability check-stability
$(BUILD)/tests/stability.o: tests/bench/stability.c
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -Itests -c $< -o $@
$(BUILD)/tests/stability: $(BUILD)/tests/stability.o $(BUILD)/tests/libtest.a
	@$(CXX) $(SANITIZE) -o $@ $^ $(LIBS_TEST)
stability: ## examples/STABILITY.md: what breaks published methods, what they give, what rqt gives
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/stability
	@BUILD=$(BUILD) ./tests/bench/stability.sh examples/charts/stability.png > $(BUILD)/STABILITY.md
	@mv $(BUILD)/STABILITY.md examples/STABILITY.md && echo "examples/STABILITY.md and its picture are written"
check-stability: ## fail when that page is not what the code gives, or a case has no test or nothing that fails it
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 $(BUILD)/tests/stability
	@BUILD=$(BUILD) ./tests/bench/stability.sh | diff -u examples/STABILITY.md - && echo "examples/STABILITY.md is what make stability writes"
	@./tests/check_catalogue.sh
check-docs: check-stability

chart: ## speed against accuracy, drawn: pictures in build/chart; peers from npm where there is one; DATA=dir
	@./src/install-packages.sh build test
	@./src/install-packages.sh peers || echo "No node: the charts go without peers" >&2
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) DATA="$(if $(filter command% environment%,$(origin DATA)),$(DATA))" DOCS=$(DOCS) ./tests/bench/chart.sh
chart-views: ## views by the guaranteed test beside those of the literature, drawn: pictures in build/chart; DATA=dir
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) DATA="$(if $(filter command% environment%,$(origin DATA)),$(DATA))" DOCS=$(DOCS) ./tests/bench/chart_views.sh
peers: ## vertices at equal true error beside a greedy TIN and RTIN, for six DEMs of DATA=dir
	@./src/install-packages.sh build test
	@./src/install-packages.sh peers || echo "No node: the table goes without peers" >&2
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) DATA="$(DATA)" OUT=$(BUILD)/chart ./tests/bench/peers.sh

# ---------------------------------------------------------------------------------------------------- install
PREFIX ?= /usr/local
.PHONY: install clean help
install: all ## copy rqt to PREFIX/bin and rqt.so to PREFIX/lib
	install -D -m 755 $(BUILD)/rqt $(DESTDIR)$(PREFIX)/bin/rqt
	install -D -m 644 $(BUILD)/rqt.so $(DESTDIR)$(PREFIX)/lib/rqt.so
clean: ## remove the build directory
	rm -rf $(BUILD)
help: ## this list
	@sed -n 's/^\([a-z0-9-]*\):.*## \(.*\)/\1|\2/p' $(firstword $(MAKEFILE_LIST)) | awk -F'|' '{ printf "  make %-14s %s\n", $$1, $$2 }'

# Keep what the test programs are made of.
.SECONDARY:
-include $(shell find $(BUILD) -name '*.d' 2>/dev/null)

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
INCLUDES = -Isrc/core -Isrc/store -Isrc/geo -Isrc/verify -Isrc/format -Isrc/import -Iext -I$(BUILD)/generated

CORE = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/core/*.c))
PLAIN = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/verify/*.c src/format/*.c))
GEO = $(BUILD)/geo/geo.o
SQL_SOURCES = $(wildcard src/store/*.c ext/*.c)
SQL_HOSTED = $(patsubst %.c,$(BUILD)/hosted/%.o,$(SQL_SOURCES))
SQL_LINKED = $(patsubst %.c,$(BUILD)/linked/%.o,$(SQL_SOURCES))
IMPORT = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/import/*.c))
CLI = $(patsubst src/%.c,$(BUILD)/%.o,$(wildcard src/cli/*.c))
GENERATED = $(BUILD)/generated/schema_sql.h

LIBS_CORE = -lzstd -lm
LIBS_EXT = -lGeographicLib -lcjson $(LIBS_CORE)
LIBS_CLI = $(LIBS_EXT) -lsqlite3 $(shell gdal-config --libs 2>/dev/null) $(shell pkg-config --libs cairo libpng 2>/dev/null) -lpthread -lstdc++
GDAL_CFLAGS = $(shell gdal-config --cflags 2>/dev/null)
CAIRO_CFLAGS = $(shell pkg-config --cflags cairo libpng 2>/dev/null)

.PHONY: all
all: ## build the command and the extension: build/rqt and build/rqt.so
	@./src/install-packages.sh build
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

$(BUILD)/rqt: $(CLI) $(SQL_LINKED) $(IMPORT) $(PLAIN) $(GEO) $(BUILD)/librqt.a
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
$(BUILD)/generated/schema_sql.h: sql/schema.sql sql/terrain.sql sql/geopackage.sql
	@mkdir -p $(@D)
	@for f in schema terrain geopackage; do \
	  printf 'static const char sql_%s[] =\n' $$f; \
	  sed -e '/^--/d' -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/^/    "/' -e 's/$$/\\n"/' sql/$$f.sql; printf '    ;\n'; \
	done > $@

# ------------------------------------------------------------------------------------------------------- demo
.PHONY: demo
demo: all ## import a real DEM and show what rqt does with it; pictures in build/demo
	@BUILD=$(BUILD) ./examples/demo.sh

# ------------------------------------------------------------------------------------------------------ tests
# Everything that a test may want of us in one archive; the linker takes what each one needs.
TEST_PROGRAMS = $(patsubst tests/%.c,$(BUILD)/tests/%,$(wildcard tests/test_*.c))
TEST_PARTS = $(BUILD)/tests/oracle.o $(SQL_LINKED) $(IMPORT) $(PLAIN) $(GEO)
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
	@$(CXX) $(SANITIZE) -o $@ $^ $(LIBS_TEST)

.PHONY: test-programs test test-quick test-sanitize
test-programs: $(TEST_PROGRAMS)
	@:

test: ## install, build, and pass every test (also under ASan and UBSan)
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products test-programs
	@$(MAKE) --no-print-directory -j2 BUILD=$(BUILD)/sanitized OPTIMIZE=-O1 \
	  SANITIZE="-fsanitize=address,undefined -fno-sanitize-recover=undefined" products test-programs
	@BUILD=$(BUILD) ./tests/run.sh

test-quick: ## the tests without the sanitized build
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products test-programs
	@BUILD=$(BUILD) ./tests/run.sh quick

.PHONY: mutants
mutants: ## break the code in one line, many times over: each time a named test must go red
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 test-programs
	@/usr/bin/python3 tests/mutants.py $(BUILD)

DATA ?= tests/data
.PHONY: verify-data
verify-data: ## rqt_verify over every DEM of DATA=dir at nine eps
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/bench/verify_data.sh $(DATA)

.PHONY: check-layers
check-layers: ## modules depend one way only; librqt.a and rqt.so mention only what they may
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@BUILD=$(BUILD) ./tests/check_layers.sh

FORMATTED = $(wildcard src/*/*.[ch] src/geo/*.cpp ext/*.[ch] tests/*.[ch] tests/bench/*.[ch] tests/bench/peers/*.[ch])
.PHONY: format check-format
format: ## lay the sources out (clang-format)
	@./src/install-packages.sh format
	clang-format -i $(FORMATTED)
check-format: ## fail when a source is not laid out
	@./src/install-packages.sh format
	@clang-format --dry-run -Werror $(FORMATTED) && echo "layout: all of $(words $(FORMATTED)) files"

.PHONY: docs check-docs
docs: products ## write ext/SQL.md from the function table
	@./tests/sql_reference.sh $(BUILD) > ext/SQL.md
check-docs: ## fail when ext/SQL.md or the README's session are not what the program says
	@./src/install-packages.sh build test
	@$(MAKE) --no-print-directory -j2 products
	@./tests/sql_reference.sh $(BUILD) | diff -u ext/SQL.md - && echo "ext/SQL.md is what the function table says"
	@BUILD=$(BUILD) ./tests/check_readme.sh

# ---------------------------------------------------------------------------------------------------- benches
.PHONY: bench bench-data bench-update bench-table1 chart peers
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

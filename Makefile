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
	@./tests/setup.sh build
	@$(MAKE) --no-print-directory products

.PHONY: products
products: $(BUILD)/rqt $(BUILD)/rqt.so

$(BUILD)/librqt.a: $(CORE)
	@rm -f $@
	@echo "  archive $@"; ar rcs $@ $^

$(BUILD)/rqt.so: $(SQL_HOSTED) $(PLAIN) $(GEO) $(BUILD)/librqt.a ext/exports.map
	@echo "  link $@"; $(CXX) $(SANITIZE) -shared -Wl,--version-script=ext/exports.map -Wl,-z,defs -o $@ $(SQL_HOSTED) $(PLAIN) $(GEO) $(BUILD)/librqt.a $(LIBS_EXT)

$(BUILD)/rqt: $(CLI) $(SQL_LINKED) $(IMPORT) $(PLAIN) $(GEO) $(BUILD)/librqt.a
	@echo "  link $@"; $(CXX) $(SANITIZE) -o $@ $^ $(LIBS_CLI)

$(BUILD)/hosted/%.o: %.c $(GENERATED)
	@mkdir -p $(@D)
	@echo "  compile $<"; $(CC) $(CFLAGS) $(INCLUDES) -c $< -o $@
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

# The SQL that a person can read is the SQL that the program runs.
$(BUILD)/generated/schema_sql.h: sql/schema.sql sql/terrain.sql sql/geopackage.sql
	@mkdir -p $(@D)
	@for f in schema terrain geopackage; do \
	  printf 'static const char sql_%s[] =\n' $$f; \
	  sed -e '/^--/d' -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/^/    "/' -e 's/$$/\\n"/' sql/$$f.sql; printf '    ;\n'; \
	done > $@

-include $(shell find $(BUILD) -name '*.d' 2>/dev/null)

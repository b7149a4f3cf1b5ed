#!/bin/bash
# check_layers.sh - the arrows between the rooms point one way, and the libraries mention only what they may.
#
# core <- store <- ext <- serve <- cli;  core <- store <- import <- cli;  core <- format <- ext;  geo and verify <- ext;  store <- text <- picture <- serve, cli;
# store, format, geo <- tiles <- serve, cli.
set -u
BUILD=${BUILD:-build}
passed=0 failed=0
say() { # true/false text
    if [ "$1" = true ]; then passed=$((passed + 1)); echo "ok      $2"; else failed=$((failed + 1)); echo "FAILED  $2"; fi
}

may_see() {
    case $1 in
    core) echo core ;;
    store) echo store core ;;
    format) echo format core ;;
    geo) echo geo ;;
    verify) echo verify ;;
    import) echo import store core ;;
    ext) echo ext store core format geo verify ;;
    text) echo text store core ;;
    picture) echo picture text store core ;;
    tiles) echo tiles store core format geo ;;
    serve) echo serve ext core format picture tiles ;;
    cli) echo cli serve tiles picture text import ext store core format geo verify ;;
    esac
}
room_of_header() { # name, room that includes it
    for room in $2 core store format geo verify import ext text picture tiles serve cli; do
        dir=src/$room; [ "$room" = ext ] && dir=ext
        [ -n "$(find "$dir" -name "$1" -print -quit)" ] && { echo "$room"; return; }
    done
    echo system
}
wrong=
for room in core store format geo verify import ext text picture tiles serve cli; do
    dir=src/$room; [ "$room" = ext ] && dir=ext
    for file in "$dir"/*.[ch] "$dir"/*/*.[ch] "$dir"/*.cpp; do
        [ -e "$file" ] || continue
        for header in $(sed -n 's/^#include "\(.*\)"/\1/p' "$file"); do
            [ "$header" = schema_sql.h ] && continue
            other=$(room_of_header "$header" "$room")
            case " $(may_see $room) " in *" $other "*) ;; *) wrong="$wrong $file->$header" ;; esac
        done
        # internal headers stay in their room: the compiler would take the wrong one otherwise
        if [ "$room" != import ] && grep -qE '#include [<"](gdal|ogr|cpl)' "$file"; then wrong="$wrong $file->GDAL"; fi
        case $room in core | format | geo | verify)
            if grep -qE '#include [<"]sqlite' "$file"; then wrong="$wrong $file->SQLite"; fi ;;
        esac
    done
done
say "$([ -z "$wrong" ] && echo true)" "every #include points down the rooms$wrong"

allowed='^(ZSTD_.*|mem(cpy|set|move|cmp|chr)|str(len|cmp|ncmp|chr|tod|ncasecmp)|ldexp|frexp|nextafter|nearbyint|rint|llrint|floor|ceil|fabs|fmin|fmax|log2|sqrt|tan|trunc|round|atan|asin|sin|hypot|__stack_chk_fail|_GLOBAL_OFFSET_TABLE_|__errno_location|__cpu_model|__cpu_indicator_init|__(add|mul|sub|div|mod|udiv|umod|float|fix).*ti.*|__float.*|__ctype_b_loc|__mem.*_chk)$'
inside=$(nm --defined-only "$BUILD/librqt.a" 2>/dev/null | awk 'NF==3 {print $3}' | sort -u)
outside=$(nm -u "$BUILD/librqt.a" | awk '$1=="U" {print $2}' | sort -u | comm -23 - <(echo "$inside") | grep -vE "$allowed" | tr '\n' ' ')
say "$([ -z "$outside" ] && echo true)" "librqt.a needs libc's memory and text functions, libm and zstd only $outside"

# .data.rel.ro holds constants with addresses in them, read-only once loaded.
writable=$(objdump -t "$BUILD/librqt.a" | awk 'NF >= 5 && $(NF-2) ~ /^(\.data|\.bss|\*COM\*)/ && $(NF-2) !~ /^\.data\.rel\.ro/ && $NF !~ /^\./ {print $NF}' | tr '\n' ' ')
say "$([ -z "$writable" ] && echo true)" "librqt.a has no variable that changes $writable"

exports=$(nm -D --defined-only "$BUILD/rqt.so" | awk '{print $3}' | tr '\n' ' ')
say "$([ "$exports" = 'sqlite3_rqt_init ' ] && echo true)" "rqt.so exports its entry point only: $exports"
linked=$(readelf -d "$BUILD/rqt.so" | sed -n 's/.*Shared library: \[\(.*\)\]/\1/p' | grep -E 'gdal|sqlite' | tr '\n' ' ')
say "$([ -z "$linked" ] && echo true)" "rqt.so is linked to neither GDAL nor an SQLite of its own $linked"
sqlite=$(nm -D -u "$BUILD/rqt.so" | grep -c ' sqlite3_')
say "$([ "$sqlite" = 0 ] && echo true)" "rqt.so calls SQLite through its host only"
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]

#!/bin/sh
# embed.sh FOLDER FILE... - writes C with the files in it, gzipped, a table of names: what page.c serves. FOLDER is for the
# gzipped files.
#
# The assembler takes the bytes as they are, so that a megabyte costs nothing to compile.
set -eu
folder=$1
shift
mkdir -p "$folder"
echo '/* Written by src/serve/embed.sh. */'
echo '#include "web_files.h"'
n=0
for file in "$@"; do
    packed=$folder/$(basename "$file").gz
    gzip -9 -n -c "$file" >"$packed"
    printf '__asm__(".section .rodata\\n.balign 16\\nweb_%d:\\n.incbin \\"%s\\"\\nweb_%d_end:\\n.byte 0\\n.previous\\n");\n' $n "$packed" $n
    printf 'extern const unsigned char web_%d[], web_%d_end[];\n' $n $n
    n=$((n + 1))
done
echo 'const web_file web_files[] = {'
n=0
for file in "$@"; do
    printf '    {"%s", web_%d, web_%d_end},\n' "$(basename "$file")" $n $n
    n=$((n + 1))
done
printf '};\nconst int web_file_count = %d;\n' $n

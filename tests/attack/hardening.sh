#!/bin/sh
# hardening.sh PROGRAM...: what the compiler and the linker were told is in the programs.
set -eu
failed=0

shows() { # program, option of readelf, pattern, what is missing without it
    readelf -W "$2" "$1" | grep -q "$3" && return
    echo "$1: no $4"
    failed=1
}

# In the start files of the C library there are fewer.
has_landing_pads() { # program
    [ "$(uname -m)" != x86_64 ] && return
    [ "$(objdump -d --no-show-raw-insn "$1" | grep -c 'endbr64')" -ge 100 ] && return
    echo "$1: no landing pads (-fcf-protection)"
    failed=1
}

for program; do
    shows "$program" -l GNU_RELRO "read-only relocations"
    shows "$program" -d 'FLAGS_1.* NOW' "binding of all symbols at the start"
    shows "$program" -d 'FLAGS_1.* PIE' "position-independent code"
    shows "$program" -l 'GNU_STACK.* RW ' "stack without code"
    shows "$program" --dyn-syms __stack_chk_fail "stack canaries"
    shows "$program" --dyn-syms __memcpy_chk "checked functions of the C library"
    has_landing_pads "$program"
done
exit $failed

#!/usr/bin/env bash
# What cmake/hardening.cmake asks for is in the program.
#   hardening_test.sh PATH/TO/meshreduce READELF
set -uo pipefail
program=$1 readelf=$2
source "$(dirname "$0")/../support/check.sh"

headers=$("$readelf" --wide --file-header --program-headers "$program") || exit 1
dynamic=$("$readelf" --wide --dynamic "$program") || exit 1
symbols=$("$readelf" --wide --dyn-syms "$program") || exit 1

has() {  # has WHAT PATTERN TEXT
  grep -qE -- "$2" <<<"$3" || fail_test "$1: no '$2' in the headers of $program"
}
has "it runs at any address" "Type: +DYN" "$headers"
has "tables of functions cannot be written once it runs" "GNU_RELRO" "$headers"
has "and are filled before it runs" "BIND_NOW" "$dynamic"
has "the stack has a header" "GNU_STACK" "$headers"
grep GNU_STACK <<<"$headers" | grep -qE " RW +0x" || fail_test "code can run on the stack"
has "overwritten stacks are noticed" " UND __stack_chk_fail@" "$symbols"
has "lengths of copies are checked" " UND __[a-z]+_chk@" "$symbols"
finish

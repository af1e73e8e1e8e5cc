# For test scripts: `check` runs a command and looks at its exit code and output; `finish` ends the script.
failures=0

fail_test() { echo "FAILED $1"; failures=$((failures + 1)); }

check() {  # check NAME EXPECTED_CODE PATTERN COMMAND...   (code: a number, or `fails`)
  local name=$1 code=$2 pattern=$3 output
  shift 3
  output=$("$@" 2>&1)
  local got=$?
  if { [ "$code" = fails ] && [ $got -eq 0 ]; } || { [ "$code" != fails ] && [ $got -ne "$code" ]; }; then
    fail_test "$name: exit $got, expected $code: $output"; return
  fi
  if [ $got -gt 127 ]; then fail_test "$name: killed ($got): $output"; return; fi
  grep -qE -- "$pattern" <<<"$output" || fail_test "$name: no '$pattern' in: $output"
}

finish() {
  [ $failures -eq 0 ] && echo "all passed"
  exit $((failures > 0))
}

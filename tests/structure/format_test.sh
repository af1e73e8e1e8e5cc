#!/usr/bin/env bash
# Every C++ file is formatted as .clang-format says; `clang-format -i FILE` mends it.
set -euo pipefail
cd "$(dirname "$0")/../.."
find src apps tests fuzz bench -name '*.h' -o -name '*.cpp' | xargs clang-format --dry-run -Werror

#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The tree holds no path of anybody's machine, no tab and no mark of an unfinished merge. Every source names its licence,
# and every text file ends with a line end. Files that state the version agree. Usage: tree.sh ROOT
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "$0")/source_files.sh"
root=$1
mapfile -d '' -t files < <(list_sources "$root" '*.h' '*.cpp' '*.in' '*.txt' '*.cmake' '*.sh' '*.py' '*.pyi' '*.md' '*.toml' '*.json' '*.cff' '*.yml' '*Snakefile')
((${#files[@]} > 0)) || { echo "no sources found below $root" >&2; exit 1; }
cd "$root"
failed=no
# Such paths are home folders, scratch folders and mounts.
if grep -nE '(^|[^[:alnum:]._$}/-])/(home/[a-z]|root/|work/|mnt/|Users/|tmp/[a-z]+/)' -- "${files[@]}"; then
  echo "tree: the lines above hold a path of one machine" >&2
  failed=yes
fi
if grep -nE '^(<{7}|>{7}) ' -- "${files[@]}"; then
  echo "tree: the lines above are marks of an unfinished merge" >&2
  failed=yes
fi
# A tab was meant to be "\t", or is indentation that looks different in every editor.
if grep -nP '\t' -- "${files[@]}"; then
  echo "tree: the lines above hold a tab" >&2
  failed=yes
fi
for file in "${files[@]}"; do
  if [[ -s "$file" && -n "$(tail -c 1 "$file")" ]]; then
    echo "$file: no line end at the end of the file" >&2
    failed=yes
  fi
  case "$file" in
    *.h | *.cpp | *.cmake | *.sh | *.py | *.pyi | */CMakeLists.txt | CMakeLists.txt | */Snakefile)
      if ! head -n 3 "$file" | grep -q 'SPDX-License-Identifier: Apache-2.0'; then
        echo "$file: no SPDX line" >&2
        failed=yes
      fi
      ;;
  esac
done
version=$(sed -n 's/^project(.* VERSION \([0-9.]*\) .*/\1/p' CMakeLists.txt)
[[ "$version" == *.*.* ]] || { echo "tree: CMakeLists.txt states no version" >&2; exit 1; }
interface=${version%.*}
while IFS=: read -r file text; do
  if ! grep -qF -- "$text" "$file"; then
    echo "$file: no '$text', though CMakeLists.txt states version $version" >&2
    failed=yes
  fi
done <<END
CITATION.cff:version: $version
docs/changelog.md:## $version
docs/library.md:find_package(AttenuationFields $interface REQUIRED)
docs/library.md:libattenuation_fields.so.$interface
docs/packages.md:libattenuation-fields$interface
python/af_programs/argument_pages.py:VERSION = "$version"
tests/library/example/CMakeLists.txt:find_package(AttenuationFields $interface REQUIRED)
END
[[ "$failed" == no ]] || exit 1
echo "tree: ${#files[@]} files hold no machine's path and name their licence"

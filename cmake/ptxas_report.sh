#!/bin/sh
# Runs the CUDA compiler given as arguments and puts what its assembler says of each kernel (registers, stack, spills) into
# OBJECT.ptxas, beside the object file; every other message is passed on. tests/test_spills.py reads these files.
object=
previous=
for word in "$@"; do
  if [ "$previous" = -o ]; then object=$word; fi
  previous=$word
done
[ -n "$object" ] || exec "$@"

"$@" 2>"$object.messages"
status=$?
report='^ptxas info|^ +[0-9]+ bytes stack frame'
grep -E "$report" "$object.messages" >"$object.ptxas"
grep -vE "$report" "$object.messages" >&2
rm -f "$object.messages"
exit $status

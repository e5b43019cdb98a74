#!/bin/sh
# Starts the program of bin/ with this script's name (`run NAME`: another one) on the libraries of lib/. The search path of the user
# stays, behind ours: libcuda and other parts of a driver are not in lib/ and are found where they always are.
file=$0
if [ -L "$file" ]; then file=$(readlink -f -- "$file"); fi
case $file in */*) folder=${file%/*} ;; *) folder=. ;; esac
folder=$(cd "$folder" && pwd) || exit 1
name=${file##*/}
if [ "$name" = run ]; then
  [ $# -gt 0 ] || { echo "usage: run PROGRAM [arguments]; there are: $(ls "$folder/bin" | tr '\n' ' ')" >&2; exit 1; }
  name=$1
  shift
fi
path=$folder/lib
# glibc's companion for exceptions: the system's own, which fits its glibc, unless it has none.
found=
for place in /lib64 /usr/lib64 /lib /usr/lib /lib/*-linux-gnu /usr/lib/*-linux-gnu; do
  if [ -e "$place/libgcc_s.so.1" ]; then found=1; fi
done
if [ -z "$found" ]; then path=$path:$folder/lib/gcc; fi
LD_LIBRARY_PATH=$path${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
export LD_LIBRARY_PATH
exec "$folder/bin/$name" "$@"

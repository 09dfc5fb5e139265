#!/bin/sh
# fake_bench.sh NAME OPTIONS [OPTION...]: stands in for helio-bench. What it does, by NAME:
#   realtime  progress and a result     echo    the result holds the options it got
#   nothing   an error                  silent  no last line       killed  dies of a signal
#   hangs     waits to be told to stop, and says so in the file `stopped`
while [ $# -gt 2 ]; do # options come first, each with its value
    shift 2
done
case $1 in
realtime)
    echo 'progress [1,2]'
    echo 'progress [2,2]'
    echo 'result {"ok":1}'
    ;;
echo) printf 'result %s\n' "$2" ;;
silent) echo 'progress [1,2]' ;;
killed) kill -9 $$ ;;
hangs)
    trap 'echo > stopped; exit 1' TERM
    while :; do sleep 0.05; done
    ;;
*)
    echo 'error {"code":7,"what":"bench","where":"name","reason":"no benchmark of that name"}'
    exit 1
    ;;
esac

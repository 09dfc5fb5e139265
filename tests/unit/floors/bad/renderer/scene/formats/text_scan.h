// what readers share

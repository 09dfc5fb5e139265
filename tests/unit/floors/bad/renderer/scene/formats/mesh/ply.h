// the PLY reader

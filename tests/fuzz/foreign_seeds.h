// foreign_seeds.h - whole files of binary formats that foreign libraries read and none of them
// writes, made here: PSD, DDS, binary FBX. Test code.
#ifndef HG_TESTS_FUZZ_FOREIGN_SEEDS_H
#define HG_TESTS_FUZZ_FOREIGN_SEEDS_H

#include "base/bytes.h"

struct foreign_seed {
    const char *name;
    void (*write)(struct hg_writer *w); // the caller finishes it
};

enum { FOREIGN_SEEDS = 4 };
extern const struct foreign_seed foreign_seeds[FOREIGN_SEEDS];

#endif

#include <stdint.h>

int helio_open(void);

// floor 0
#include <stdint.h>

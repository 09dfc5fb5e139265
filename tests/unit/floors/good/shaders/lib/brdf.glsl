#include "shared/types.h"

#include "protocol/hgp.h"

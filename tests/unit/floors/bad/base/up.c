#include "protocol/wire.h" // caught: floor

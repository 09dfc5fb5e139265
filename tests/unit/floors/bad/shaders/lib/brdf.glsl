#include "passes/shade.comp" // caught: floor

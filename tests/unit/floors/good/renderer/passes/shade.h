#include "renderer/passes/pass.h"

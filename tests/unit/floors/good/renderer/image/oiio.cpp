#include "renderer/image/image.h"

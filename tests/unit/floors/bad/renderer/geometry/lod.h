#include "renderer/texture/page.h" // caught: down

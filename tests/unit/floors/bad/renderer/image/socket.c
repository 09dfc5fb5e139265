#include <arpa/inet.h> // caught: socket

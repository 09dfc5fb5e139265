#include <sys/socket.h> // caught: socket
  #  include <netinet/in.h> // caught: socket

// Serves the echo that `sightline bench --echo ADDRESS` is compared with, until its standard input ends.
//
//   echo_server ADDRESS     host:port or unix:/path; prints the address once it serves
#include <iostream>
#include <limits>

#include "tests/bench/echo_server.h"

int main(int argc, char** argv) {
  if (argc != 2) return std::cerr << "usage: echo_server ADDRESS\n", 2;
  const auto echo = sightline::EchoServer::start(argv[1]);
  if (!echo) return std::cerr << to_string(echo.error()) << '\n', 1;
  std::cout << (*echo)->address() << std::endl;
  std::cin.ignore(std::numeric_limits<std::streamsize>::max());
}

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arpa/inet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <string>

namespace pagesweep::testing {

/// Gives the loopback interface another address.
inline bool add_loopback_address(int descriptor, const std::string& label, const std::string& address) {
  ifreq request{};
  std::strncpy(request.ifr_name, label.c_str(), IFNAMSIZ - 1);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  inet_pton(AF_INET, address.c_str(), &own.sin_addr);
  std::memcpy(&request.ifr_addr, &own, sizeof own);
  if (::ioctl(descriptor, SIOCSIFADDR, &request) != 0) return false;
  request.ifr_flags = IFF_UP | IFF_LOOPBACK | IFF_RUNNING;
  return ::ioctl(descriptor, SIOCSIFFLAGS, &request) == 0;
}

/// Sets the loopback interface's largest packet [bytes].
inline bool set_loopback_mtu(int mtu) {
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM, 0);
  ifreq request{};
  std::strncpy(request.ifr_name, "lo", IFNAMSIZ - 1);
  request.ifr_mtu = mtu;
  const bool is_set = ::ioctl(descriptor, SIOCSIFMTU, &request) == 0;
  ::close(descriptor);
  return is_set;
}

/// Moves the calling thread, and those that it starts, into a network of its own with nothing but 127.0.0.1 to
/// 127.0.0.3, so that a test meets neither real cameras nor other tests.
/// \return false where the system does not permit that
inline bool enter_own_network() {
  static const bool is_entered = [] {
    if (::unshare(CLONE_NEWNET) != 0 && ::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return false;
    const int descriptor = ::socket(AF_INET, SOCK_DGRAM, 0);
    const bool is_ready = add_loopback_address(descriptor, "lo", "127.0.0.1") &&
                          add_loopback_address(descriptor, "lo:1", "127.0.0.2") &&
                          add_loopback_address(descriptor, "lo:2", "127.0.0.3");
    ::close(descriptor);
    return is_ready;
  }();
  return is_entered;
}

}  // namespace pagesweep::testing

// SPDX-License-Identifier: Apache-2.0
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <string>

#include "pagesweep/live/interface_mtu_internal.h"

namespace pagesweep {
namespace {

std::optional<int> mtu_of(const char* interface) {
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM, 0);
  if (descriptor < 0) return std::nullopt;
  ifreq request{};
  std::strncpy(request.ifr_name, interface, IFNAMSIZ - 1);
  const bool is_known = ::ioctl(descriptor, SIOCGIFMTU, &request) == 0;
  ::close(descriptor);
  return is_known ? std::optional(request.ifr_mtu) : std::nullopt;
}

}  // namespace

std::optional<int> interface_mtu(ArvGvDevice* device) {
  GSocketAddress* address = arv_gv_device_get_interface_address(device);
  sockaddr_in own{};
  if (!address || !g_socket_address_to_native(address, &own, sizeof own, nullptr)) return std::nullopt;
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return std::nullopt;
  std::optional<int> mtu;
  for (const ifaddrs* each = all; each && !mtu; each = each->ifa_next) {
    if (!each->ifa_addr || each->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in other{};
    std::memcpy(&other, each->ifa_addr, sizeof other);
    if (other.sin_addr.s_addr == own.sin_addr.s_addr) mtu = mtu_of(each->ifa_name);
  }
  ::freeifaddrs(all);
  return mtu;
}

}  // namespace pagesweep

// SPDX-License-Identifier: Apache-2.0
#include <arpa/inet.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "pagesweep/live/gige_probe_internal.h"

namespace pagesweep {
namespace {

constexpr std::uint16_t control_port = 3956;
constexpr int tries = 3, answer_ms = 200;
// "Read register", id 1, register 0x0a00; the answer repeats the id and ends with the value. In network order.
constexpr std::array<std::uint8_t, 12> question{0x42, 0x01, 0x00, 0x80, 0x00, 0x04, 0x00, 0x01, 0x00, 0x00, 0x0a, 0x00};
constexpr std::size_t header_bytes = 8;

std::optional<in_addr> parse(const std::string& address) {
  in_addr parsed{};
  return ::inet_pton(AF_INET, address.c_str(), &parsed) == 1 ? std::optional(parsed) : std::nullopt;
}

GigeAnswer ask(int descriptor) {
  for (int i = 0; i < tries; ++i) {
    if (::send(descriptor, question.data(), question.size(), 0) < 0) continue;  // a refusal of the try before
    pollfd waiting{descriptor, POLLIN, 0};
    if (::poll(&waiting, 1, answer_ms) <= 0) continue;
    std::array<std::uint8_t, 64> answer{};
    const ssize_t size = ::recv(descriptor, answer.data(), answer.size(), 0);
    if (size < static_cast<ssize_t>(header_bytes)) continue;
    const bool is_refused = answer[0] != 0 || answer[1] != 0;  // who has it exclusively lets nobody read
    bool is_controlled = false;
    for (std::size_t k = header_bytes; k < static_cast<std::size_t>(size); ++k) is_controlled |= answer[k] != 0;
    return is_refused || is_controlled ? GigeAnswer::taken : GigeAnswer::free;
  }
  return GigeAnswer::none;
}

/// "eth0 192.168.3.1/24"
struct Network {
  std::string text;
  std::uint32_t address = 0, mask = 0;
};

std::vector<Network> own_networks() {
  std::vector<Network> networks;
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return networks;
  for (const ifaddrs* each = all; each; each = each->ifa_next) {
    if (!each->ifa_addr || !each->ifa_netmask || each->ifa_addr->sa_family != AF_INET) continue;
    if ((each->ifa_flags & IFF_UP) == 0) continue;
    const auto* address = reinterpret_cast<const sockaddr_in*>(each->ifa_addr);
    const auto* mask = reinterpret_cast<const sockaddr_in*>(each->ifa_netmask);
    std::array<char, INET_ADDRSTRLEN> text{};
    ::inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size());
    networks.push_back(
        {fmt::format("{} {}/{}", each->ifa_name, text.data(), std::popcount(std::uint32_t{mask->sin_addr.s_addr})),
         address->sin_addr.s_addr, mask->sin_addr.s_addr});
  }
  ::freeifaddrs(all);
  return networks;
}

}  // namespace

std::optional<GigeAnswer> probe_gige(const std::string& address) {
  const auto parsed = parse(address);
  if (!parsed) return std::nullopt;
  sockaddr_in camera{};
  camera.sin_family = AF_INET, camera.sin_port = htons(control_port), camera.sin_addr = *parsed;
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return std::nullopt;
  GigeAnswer answer = GigeAnswer::none;
  if (::connect(descriptor, reinterpret_cast<const sockaddr*>(&camera), sizeof camera) == 0) answer = ask(descriptor);
  ::close(descriptor);
  return answer;
}

std::string why_silent(const std::string& id) {
  const auto address = parse(id);
  if (!address) return "see that it has power and a cable; `pagesweep cameras` lists those that answer, with their ids";
  std::vector<std::string> texts;
  for (const Network& network : own_networks()) {
    if (((network.address ^ address->s_addr) & network.mask) == 0)
      return fmt::format(
          "its address belongs to this computer's network {}: see that it has power and a cable, that "
          "this is its address, and that no firewall drops UDP port {}",
          network.text, control_port);
    texts.push_back(network.text);
  }
  return fmt::format(
      "its address is in no network of this computer, which has {}: give one of them an address beside "
      "it, or the camera one of theirs",
      texts.empty() ? "none" : fmt::format("{}", fmt::join(texts, ", ")));
}

}  // namespace pagesweep

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <map>
#include <sstream>
#include <string>

namespace pagesweep::test {

/// Enough of a PDF reader to check one byte by byte: finds objects by the cross-reference table alone.
class PdfReader {
 public:
  explicit PdfReader(std::string bytes) : bytes_(std::move(bytes)) {
    const std::size_t start = bytes_.rfind("startxref\n");
    const std::size_t table = std::stoul(bytes_.substr(start + 10));
    EXPECT_EQ(bytes_.compare(table, 7, "xref\n0 "), 0);
    std::istringstream lines(bytes_.substr(table, start - table));
    std::string line;
    std::getline(lines, line);
    std::getline(lines, line);
    const int count = std::stoi(line.substr(2));
    std::getline(lines, line);  // the free entry
    for (int object = 1; object < count; ++object) {
      std::getline(lines, line);
      EXPECT_EQ(line.size(), 19u) << "an entry has 20 bytes with its line end";
      places_[object] = std::stoul(line);
    }
    trailer_ = bytes_.substr(bytes_.find("trailer", table), start - bytes_.find("trailer", table));
  }

  const std::string& trailer() const { return trailer_; }
  int objects() const { return static_cast<int>(places_.size()); }
  /// What stands between "N 0 obj" and "endobj".
  std::string object(int number) const {
    const std::string head = std::to_string(number) + " 0 obj\n";
    const std::size_t at = places_.at(number);
    EXPECT_EQ(bytes_.compare(at, head.size(), head), 0) << number;
    const std::size_t data = bytes_.find("stream\n", at), end = bytes_.find("\nendobj\n", at);
    if (data > end) return bytes_.substr(at + head.size(), end - at - head.size());
    return bytes_.substr(at + head.size(), data - at - head.size());
  }
  /// The data of a stream, unpacked; its /Length must be right.
  std::string stream(int number) const {
    const std::string entries = object(number);
    const std::size_t begin = bytes_.find("stream\n", places_.at(number)) + 7;
    const std::size_t length = std::stoul(entries.substr(entries.find("/Length ") + 8));
    EXPECT_EQ(bytes_.compare(begin + length, 17, "\nendstream\nendobj"), 0) << number;
    const std::string data = bytes_.substr(begin, length);
    return entries.find("/FlateDecode") == std::string::npos ? data : inflate(data);
  }
  /// The object that an entry refers to: "/Pages 7 0 R" gives 7.
  static int reference(const std::string& entries, const std::string& name) {
    const std::size_t at = entries.find("/" + name + " ");
    EXPECT_NE(at, std::string::npos) << name;
    return at == std::string::npos ? 0 : std::stoi(entries.substr(at + name.size() + 2));
  }

 private:
  static std::string inflate(const std::string& packed) {
    std::string data(1 << 22, '\0');
    uLongf size = data.size();
    EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(data.data()), &size, reinterpret_cast<const Bytef*>(packed.data()),
                         static_cast<uLong>(packed.size())),
              Z_OK);
    return data.substr(0, size);
  }

  std::string bytes_, trailer_;
  std::map<int, std::size_t> places_;
};

}  // namespace pagesweep::test

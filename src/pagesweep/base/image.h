// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <span>
#include <stdexcept>
#include <type_traits>

namespace pagesweep {

/// A window into somebody else's row-major pixels. Pixel (x, y) = (column, row); (0, 0) is top left.
template <class T>
class ImageView {
 public:
  ImageView() = default;
  ImageView(T* data, int width, int height, std::ptrdiff_t stride)
      : data_(data), width_(width), height_(height), stride_(stride) {}
  /// A view of mutable pixels is a view of constant ones.
  operator ImageView<const T>() const { return {data_, width_, height_, stride_}; }

  int width() const { return width_; }
  int height() const { return height_; }
  std::ptrdiff_t stride() const { return stride_; }  ///< [pixels] from one row to the next
  bool empty() const { return width_ == 0 || height_ == 0; }
  T& operator()(int x, int y) const { return data_[y * stride_ + x]; }
  std::span<T> row(int y) const { return {data_ + y * stride_, static_cast<std::size_t>(width_)}; }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

 private:
  T* data_ = nullptr;
  int width_ = 0;
  int height_ = 0;
  std::ptrdiff_t stride_ = 0;
};

/// Asks for an image that somebody else fills, see Image.
struct Unfilled {};
inline constexpr Unfilled unfilled;

/// A row-major 2d array that owns its pixels: contiguous, the first one 64-byte aligned. Copies are deep.
template <class T>
class Image {
  static_assert(std::is_trivially_destructible_v<T>, "pixels are plain values");

 public:
  Image() = default;
  /// All bytes zero. \throws std::invalid_argument  if a side is negative
  Image(int width, int height) : Image(Allocate{}, width, height) {
    std::memset(static_cast<void*>(data()), 0, size() * sizeof(T));
  }
  Image(int width, int height, T fill) : Image(Allocate{}, width, height) {
    std::uninitialized_fill_n(data(), size(), fill);
  }
  /// Pixels are what the memory held: all of them must be written before any is read.
  Image(int width, int height, Unfilled) : Image(Allocate{}, width, height) {}
  Image(const Image& other) : Image(Allocate{}, other.width_, other.height_) {
    std::uninitialized_copy_n(other.data(), size(), data());
  }
  Image(Image&& other) noexcept { swap(other); }
  Image& operator=(Image other) noexcept {
    swap(other);
    return *this;
  }
  void swap(Image& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(width_, other.width_);
    std::swap(height_, other.height_);
  }

  int width() const { return width_; }
  int height() const { return height_; }
  bool empty() const { return size() == 0; }
  std::size_t size() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }
  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  T& operator()(int x, int y) { return data_.get()[index(x, y)]; }
  const T& operator()(int x, int y) const { return data_.get()[index(x, y)]; }
  std::span<T> row(int y) { return {data() + index(0, y), static_cast<std::size_t>(width_)}; }
  std::span<const T> row(int y) const { return {data() + index(0, y), static_cast<std::size_t>(width_)}; }
  std::span<T> pixels() { return {data(), size()}; }
  std::span<const T> pixels() const { return {data(), size()}; }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
  ImageView<T> view() { return {data(), width_, height_, width_}; }
  ImageView<const T> view() const { return {data(), width_, height_, width_}; }

 private:
  static constexpr std::align_val_t alignment{64};
  struct Delete {
    void operator()(T* data) const { ::operator delete[](data, alignment); }
  };
  struct Allocate {};
  Image(Allocate, int width, int height) : width_(width), height_(height) {
    if (width < 0 || height < 0) throw std::invalid_argument("an image's sides must not be negative");
    data_.reset(static_cast<T*>(::operator new[](std::max<std::size_t>(1, size()) * sizeof(T), alignment)));
  }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }

  std::unique_ptr<T[], Delete> data_;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace pagesweep

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/timing/bell_batch_internal.h"
#include "pagesweep/timing/bell_tables_internal.h"
#include "pagesweep/timing/sensor_noise.h"

namespace pagesweep {

/// [widths at half height] to both sides of a bell's middle that is looked at when its background is taken to be
/// curved. Half a width beyond the half-height points a bell has nearly ended; a wider piece would need a more flexible
/// background.
inline constexpr double core_widths = 1.25;

/// What the samples of some pixels are like.
enum class Content {
  whole,    ///< all there, but for some at the bell's foot, in whose place stand others from there
  partial,  ///< any are missing, or were exposed later
  clipped,  ///< likewise, and some are clipped
};

/// Fits bells to the samples of some pixels at once: the estimate of fit_bell(), for frames of one exposure. It is what
/// speed depends on.
///
/// Where all samples around the bell were recorded and none is clipped, which is nearly every pixel, two or three least
/// squares steps with even weights, which with a known profile are dot products with tabulated weights, bring the bell
/// within a small part of the stripe's width; then Gauss-Newton steps weight every sample with the noise that the model
/// lets expect there. Sums run along time; the equations of all pixels are solved side by side. One a thread.
class PlainBells {
 public:
  struct Fit {
    bool converged = false;      ///< if not, the pixel is not a plain case, and nothing else here holds but
    double time = 0;             ///< [frames] where the bell was last seen, far from where it was expected
    double amplitude = 0;        ///< [gray values]
    double background = 0;       ///< [gray values]
    double time_sigma = 0;       ///< [frames] from the noise alone
    double chi_square = 0;       ///< of all samples
    int samples = 0;             ///< of which chi square is
    double log_width = 0;        ///< after fit_widths(), relative to the profile
    double log_width_sigma = 0;  ///< likewise
    double slope = 0;            ///< [gray values / frame] of the background, after fit_on_curved()
    double curvature = 0;        ///< [gray values / frame^2] likewise
  };

  /// \param tables  must outlive this
  /// \param fwhm    of the stripe [frames]
  PlainBells(const BellTables& tables, const SensorNoise& noise, double fwhm);

  /// How many samples before and after the expected middle frame every pixel must have.
  int reach() const { return batch_.middle; }
  /// How many of them are looked at with this table.
  int reach(const BellTable& table) const { return table.reach + margin_; }
  /// The table that bells of a width are fitted with.
  const BellTable& table(double log_width) const { return tables_.at(log_width); }

  void clear();
  /// Another pixel. The arrays must last until fit() and reach `most_bells` entries beyond the samples.
  /// \param table    of log_width, see table()
  /// \param gray     samples of frames centre - reach() ... centre + reach(); any number where there is none, +infinity
  ///                 where one is clipped
  /// \param present  for each of them 1 if it is there, else 0
  /// \param late     for each of them [frames] by which it was exposed later; null for all pixels: not at all
  void add(int centre, const BellTable& table, float log_width, const float* gray, const float* present,
           const float* late = nullptr);
  /// [frames] Samples that were exposed more than this before or after their frame are none of a plain case.
  double most_late() const { return most_late_; }
  /// Where the pixel that was added last is to start, unless samples of even noise can tell.
  /// \param time  [frames] after its centre
  void start_at(float time) { batch_.time[last()] = time; }
  /// Where it is to start before fit_on_curved().
  void start_at(const Fit& fit);
  void fit(Content content);
  /// Bells whose width is unknown, too; log_width is where it starts. \pre the tables cover all widths
  void fit_widths(Content content);
  /// The middle parts of bells on backgrounds that change while the stripe passes. \pre no sample was exposed later
  void fit_on_curved();
  int count() const { return batch_.count; }
  const BellBatch& batch() const { return batch_; }
  int centre(std::size_t i) const { return centre_[i]; }  ///< as add() had it
  Fit operator[](int i) const;

 private:
  std::size_t last() const { return static_cast<std::size_t>(batch_.count - 1); }
  void start(Content content);
  void start_from_extremes(std::size_t i);
  int count_samples(std::size_t i) const;

  const BellTables& tables_;
  int margin_;  ///< [frames] the expected middle may be off
  double most_late_;
  float core_;  ///< [frames] to both sides of the middle of a bell of width 1
  bool is_on_curved_ = false;
  BellBatch batch_;
  BellBatch::Each<int> centre_{};
};

}  // namespace pagesweep

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/timing/bell_batch_internal.h"
#include "pagesweep/timing/bell_tables_internal.h"
#include "pagesweep/timing/sensor_noise.h"

namespace pagesweep {

/// Fits bells to the samples of some pixels at once: the estimate of fit_bell() for the plain case, in which all
/// samples around the bell were recorded and none is clipped. That is nearly every pixel, so it is what speed depends
/// on.
///
/// Two or three least squares steps with even weights, which with a known profile are dot products with tabulated
/// weights, bring the bell within a small part of the stripe's width; then Gauss-Newton steps weight every sample with
/// the noise that the model lets expect there. Sums run along time; the equations of all pixels are solved side by
/// side. One a thread.
class PlainBells {
 public:
  struct Fit {
    bool converged = false;  ///< if not, the pixel is not a plain case, and nothing else here holds but
    double time = 0;         ///< [frames] where the bell was last seen, far from where it was expected
    double amplitude = 0;    ///< [gray values]
    double background = 0;   ///< [gray values]
    double time_sigma = 0;   ///< [frames] from the noise alone
    double chi_square = 0;   ///< of all samples
    int samples = 0;
    double log_width = 0;        ///< after fit_widths(), relative to the profile
    double log_width_sigma = 0;  ///< likewise
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
  /// \param gray     samples of frames centre - reach() ... centre + reach(); any number where there is none
  /// \param present  for each of them 1 if it is there, else 0
  /// \param late     for each of them [frames] by which it was exposed later; null for all pixels: not at all
  void add(int centre, const BellTable& table, float log_width, const float* gray, const float* present,
           const float* late = nullptr);
  /// [frames] Samples that were exposed more than this before or after their frame are none of a plain case.
  double most_late() const { return most_late_; }
  /// Bells whose samples are all there, but for some at their feet, in whose place stand others from there.
  void fit();
  /// Bells of which any samples are missing, or exposed later.
  void fit_partial();
  /// Bells whose width is unknown, too; log_width is where it starts. \pre the tables cover all widths
  /// \param partial  whether they are those of fit_partial()
  void fit_widths(bool partial);
  int count() const { return batch_.count; }
  Fit operator[](int i) const;

 private:
  void start(bool partial);
  void start_from_extremes();

  const BellTables& tables_;
  int margin_;  ///< [frames] the expected middle may be off
  double most_late_;
  BellBatch batch_;
  BellBatch::Each<int> centre_{};
};

}  // namespace pagesweep

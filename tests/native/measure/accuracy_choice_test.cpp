#include "measure/accuracy_choice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "measure/accuracy_row.h"
#include "measure/timing.h"

namespace stipple {
namespace {

AccuracyReport reportOf(std::initializer_list<std::pair<double, double>> seconds_and_psnr) {
  AccuracyReport report;
  for (const auto& [seconds, psnr] : seconds_and_psnr) {
    AccuracyRow row;
    row.name = "row " + std::to_string(report.rows.size());
    row.seconds = seconds;
    row.psnr = psnr;
    report.rows.push_back(row);
  }
  return report;
}

TEST(AccuracyChoice, TheFrontIsWhatNoOtherRowBeatsInBoth) {
  // Faster and worse; beaten; as fast as the first and worse; the best; a twin of the best.
  AccuracyReport report = reportOf({{1, 30}, {2, 29}, {1, 28}, {3, 40}, {3, 40}});
  markFront(report);
  std::vector<bool> front;
  for (const AccuracyRow& row : report.rows) front.push_back(row.is_on_front);
  EXPECT_EQ(front, (std::vector<bool>{true, false, false, true, true}));
}

TEST(AccuracyChoice, TheBestWithinATimeAndTheCheapestAboveAQuality) {
  const double never = std::numeric_limits<double>::infinity();
  const AccuracyReport report = reportOf({{1, 30}, {2, 35}, {1.5, 35}, {9, never}});
  EXPECT_EQ(bestWithin(report, 1.2), 0u);
  EXPECT_EQ(bestWithin(report, 2), 2u) << "as good as another, and faster";
  EXPECT_EQ(bestWithin(report, 100), 3u);
  EXPECT_EQ(cheapestAbove(report, 20), 0u);
  EXPECT_EQ(cheapestAbove(report, 31), 2u);
  EXPECT_EQ(cheapestAbove(report, 90), 3u) << "the reference has no error";
}

TEST(AccuracyChoice, AnImpossibleWishIsRefusedWithWhatThereIs) {
  const AccuracyReport report = reportOf({{0.25, 30}, {2, 35}});
  const auto message = [](const auto& choose) {
    try {
      choose();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
      return std::string(error.what());
    }
    return std::string("nothing was refused");
  };
  EXPECT_NE(message([&] { bestWithin(report, 0.1); }).find("row 0, needs 250 ms"),
            std::string::npos);
  EXPECT_NE(message([&] { cheapestAbove(report, 36); }).find("the best has 35 dB"),
            std::string::npos);
  EXPECT_THROW(bestWithin(report, 0), Error);
  EXPECT_THROW(cheapestAbove(report, NAN), Error);
  EXPECT_THROW(bestWithin(AccuracyReport{}, 1), Error);
}

TEST(AccuracyRow, HasTheErrorsOfItsDifferences) {
  std::vector<float> differences(1000, 0.0f);
  differences[17] = -0.5f;  // 1 in 1000 is further off than 99.9 %
  differences[400] = 0.25f;
  AccuracyRow row;
  setErrors(differences, row);
  EXPECT_EQ(row.largest_error, 0.5);
  EXPECT_EQ(row.error_99_9, 0.25);
  EXPECT_NEAR(row.psnr, -10 * std::log10((0.25 + 0.0625) / 1000), 1e-12);
  std::vector<float> none(8, 0.0f);
  setErrors(none, row);
  EXPECT_TRUE(std::isinf(row.psnr));
}

TEST(AccuracyRow, HasTheMedianAndTheQuartilesOfItsTimes) {
  AccuracyRow row;
  setSeconds({5, 1, 2, 4, 3}, row);
  EXPECT_EQ(row.repetitions, 5u);
  EXPECT_EQ(row.seconds, 3);
  EXPECT_EQ(row.seconds_low, 2);
  EXPECT_EQ(row.seconds_high, 4);
  setSeconds({2, 1}, row);
  EXPECT_EQ(row.seconds, 1.5);
}

TEST(Timing, RefusesNoRepetitionAndNoTime) {
  EXPECT_NO_THROW(validate(Timing{}));
  EXPECT_THROW(validate(Timing{0, 60}), Error);
  EXPECT_THROW(validate(Timing{1001, 60}), Error);
  EXPECT_THROW(validate(Timing{7, 0}), Error);
  EXPECT_THROW(validate(Timing{7, INFINITY}), Error);
}

}  // namespace
}  // namespace stipple

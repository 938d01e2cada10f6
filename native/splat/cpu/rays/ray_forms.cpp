#include "splat/cpu/rays/ray_forms.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stipple {

namespace {

constexpr double kGScale = 0.84932180028801904;  // sqrt(log2(e)/2)

/// |x M0 + y M1| as |L (x, y)|, L lower triangular.
void factorise(const Vec3d& m0, const Vec3d& m1, RayForm& form) {
  const double length = m1.norm();
  form.l11 = kGScale * length;
  const Vec3d unit = length > 0 ? Vec3d(m1 / length) : Vec3d(0, 0, 1);
  const double along = unit.dot(m0);
  form.l10 = kGScale * along;
  form.l00 = kGScale * (m0 - along * unit).norm();
}

/// |x W0 + y W1 + W2| as the length of an upper triangular form.
void triangulate(const Vec3d& w0, const Vec3d& w1, const Vec3d& w2, RayForm& form) {
  form.t00 = w0.norm();
  const Vec3d first = form.t00 > 0 ? Vec3d(w0 / form.t00) : Vec3d(1, 0, 0);
  form.t01 = first.dot(w1);
  form.t02 = first.dot(w2);
  const Vec3d rest1 = w1 - form.t01 * first;
  form.t11 = rest1.norm();
  const Vec3d rest2 = w2 - form.t02 * first;
  const Vec3d second = form.t11 > 0 ? Vec3d(rest1 / form.t11) : Vec3d::Zero();
  form.t12 = second.dot(rest2);
  form.t22 = (rest2 - form.t12 * second).norm();
}

/// The ellipse d^T E^-1 d <= 1 about a place, with room for rounding.
void setEllipse(double x, double y, double e00, double e01, double e11, RayReach& reach) {
  const double half_x = std::sqrt(e00), half_y = std::sqrt(e11);
  // E = R R^T with R lower triangular, L = R^-1. A needle keeps at least a thousandth of a pixel.
  const double r00 = half_x, r10 = e01 / half_x;
  const double r11 = std::sqrt(std::max(e11 - r10 * r10, 1e-6 + 1e-12 * e11));
  reach.ellipse = {x, y, 1 / r00, -r10 / (r00 * r11), 1 / r11, 1.0};
  reach.half_x = half_x + boundMargin(half_x);
  reach.half_y = half_y + boundMargin(half_y);
}

}  // namespace

RayForm rayForm(const View<double>& view, const RaySplat& splat) {
  const Vec3d& c = splat.centre;
  const Mat3d& w = splat.whiten;
  RayForm form;
  form.opacity = splat.opacity;
  form.log2_opacity = std::log2(splat.opacity);
  form.depth = c[2];
  form.nearest = c[2] - splat.radius;
  std::copy(splat.colour, splat.colour + 3, form.colour);
  form.is_holdout = splat.is_holdout;
  const Vec3d wx = w.col(0) / view.fx, wy = w.col(1) / view.fy;
  if (!view.perspective) {
    form.mean_x = view.fx * c[0] + view.cx;
    form.mean_y = view.fy * c[1] + view.cy;
    const Vec3d along = w.col(2);
    const double length = along.norm();
    factorise(crossProduct(wx, along) / length, crossProduct(wy, along) / length, form);
    form.t00 = form.t01 = form.t02 = form.t11 = form.t12 = 0;
    form.t22 = 1;
    form.n = c[2];
    form.nx = -wx.dot(along) / (length * length);
    form.ny = -wy.dot(along) / (length * length);
    return form;
  }
  form.mean_x = view.fx * c[0] / c[2] + view.cx;
  form.mean_y = view.fy * c[1] / c[2] + view.cy;
  // The ray through (dx, dy) has the direction c / z + (dx / fx, dy / fy, 0).
  const Vec3d centre = w * c;
  const Vec3d along = centre / c[2];
  const double length = along.norm();
  factorise(crossProduct(centre, wx) / length, crossProduct(centre, wy) / length, form);
  triangulate(wx / length, wy / length, along / length, form);
  form.n = c[2];
  form.nx = centre.dot(wx) / (length * length);
  form.ny = centre.dot(wy) / (length * length);
  return form;
}

RayReach rayReach(const View<double>& view, const RaySplat& splat, double least_alpha) {
  const double reach = 2 * std::log(splat.opacity / least_alpha) * (1 + 1e-9);
  // W = S^-1 A^T, so the covariance is A S^2 A^T: rows of W divided by their squared lengths.
  Mat3d axes;
  for (int k = 0; k < 3; ++k) {
    const Vec3d row = splat.whiten.row(k);
    axes.col(k) = row / row.squaredNorm();
  }
  RayReach out;
  out.centre = splat.centre;
  out.radius = splat.radius;
  const Vec3d& c = splat.centre;
  // Sheared so that the centre lies on the axis: x' = x - z c_x / c_z. Then nothing cancels.
  Mat3d sheared = axes;
  if (view.perspective) {
    sheared.row(0) -= c[0] / c[2] * axes.row(2);
    sheared.row(1) -= c[1] / c[2] * axes.row(2);
  }
  const Mat3d covariance = reach * sheared * sheared.transpose();
  if (!view.perspective) {
    setEllipse(view.fx * c[0] + view.cx, view.fy * c[1] + view.cy,
               view.fx * view.fx * covariance(0, 0), view.fx * view.fy * covariance(0, 1),
               view.fy * view.fy * covariance(1, 1), out);
    return out;
  }
  // The rays that touch the ellipsoid d^T C^-1 d = 1 about the centre make a cone, whose dual is
  // c c^T - C (Hartley and Zisserman, Multiple View Geometry, section 8.3); its section with z = 1
  // is an ellipse where the ellipsoid does not reach the plane z = 0.
  const double ahead = c[2] * c[2] - covariance(2, 2);
  if (!(ahead > 1e-3 * c[2] * c[2])) {
    out.is_around = true;
    return out;
  }
  const double x = -covariance(0, 2) / ahead, y = -covariance(1, 2) / ahead;
  const double fx = view.fx, fy = view.fy;
  setEllipse(fx * (c[0] / c[2] + x) + view.cx, fy * (c[1] / c[2] + y) + view.cy,
             fx * fx * (covariance(0, 0) / ahead + x * x),
             fx * fy * (covariance(0, 1) / ahead + x * y),
             fy * fy * (covariance(1, 1) / ahead + y * y), out);
  return out;
}

RayForm rayForm(const AffineSplat& splat) {
  RayForm form;
  const Footprint<double>& f = splat.footprint;
  form.mean_x = f.mean_x;
  form.mean_y = f.mean_y;
  form.l00 = kGScale * f.l00;
  form.l10 = kGScale * f.l10;
  form.l11 = kGScale * f.l11;
  form.t00 = form.t01 = form.t02 = form.t11 = form.t12 = 0;
  form.t22 = 1;
  form.n = splat.depth;
  form.nx = splat.slope[0];
  form.ny = splat.slope[1];
  form.opacity = f.opacity;
  form.log2_opacity = std::log2(f.opacity);
  form.depth = splat.depth;
  form.nearest = -std::numeric_limits<double>::max();
  std::copy(splat.colour, splat.colour + 3, form.colour);
  form.is_holdout = splat.is_holdout;
  return form;
}

RayReach rayReach(const AffineSplat& splat) {
  RayReach out;
  const Footprint<double>& f = splat.footprint;
  // forEachTileSpan takes the size of the ellipse from half_x.
  out.ellipse = f;
  out.half_x = splat.half_x;
  out.half_y = splat.half_y;
  return out;
}

RayMeeting meet(const RayForm& form, double x, double y) {
  const double dx = x - form.mean_x, dy = y - form.mean_y;
  const double g0 = form.l00 * dx, g1 = form.l10 * dx + form.l11 * dy;
  const double w0 = form.t00 * dx + form.t01 * dy + form.t02, w1 = form.t11 * dy + form.t12;
  const double inverse = 1 / (w0 * w0 + w1 * w1 + form.t22 * form.t22);
  return {(form.n + form.nx * dx + form.ny * dy) * inverse,
          form.opacity * std::exp2(-(g0 * g0 + g1 * g1) * inverse)};
}

}  // namespace stipple

#include "core/student.hpp"

#include <boost/math/distributions/students_t.hpp>

namespace debias {

double student_quantile(double degrees, double u) { return boost::math::quantile(boost::math::students_t(degrees), u); }

double student_density(double degrees, double x) { return boost::math::pdf(boost::math::students_t(degrees), x); }

}  // namespace debias

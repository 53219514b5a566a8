/* Rotary pendulum: an arm that turns in the horizontal plane and a slender pendulum at its end, alpha = 0 hanging down. */
const double inertia = J_p + m * l * l;
const double m11 = J_a + m * r * r + inertia * sin(alpha) * sin(alpha);
const double m12 = m * r * l * cos(alpha);
const double r_1 = tau - b_a * w_theta - k_a * theta - 2.0 * inertia * sin(alpha) * cos(alpha) * w_alpha * w_theta
    + m * r * l * sin(alpha) * w_alpha * w_alpha;
const double r_2 = tau_p - b_p * w_alpha + inertia * sin(alpha) * cos(alpha) * w_theta * w_theta - m * g * l * sin(alpha);
const double determinant = m11 * inertia - m12 * m12;
der_theta = w_theta;
der_alpha = w_alpha;
der_w_theta = (inertia * r_1 - m12 * r_2) / determinant;
der_w_alpha = (m11 * r_2 - m12 * r_1) / determinant;

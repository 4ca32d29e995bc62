//! Closed forms and solved cases from an independent implementation, one file each.

mod activation_field;
mod bars_and_springs;
mod cardiac_beam;
mod contact_closed_forms;
mod contact_of_two_bodies;
mod contact_sensitivities;
mod cooks_membrane;
mod cylinder_inflation;
mod free_contraction;
mod hertz;
mod patch_test;
mod precision;
mod prescribed_state;
mod rivlin_torsion;
mod solved_cases;
mod sphere_inflation;
pub mod support;
mod uniaxial_and_shear;

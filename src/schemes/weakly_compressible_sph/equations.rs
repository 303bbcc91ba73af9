//! The equations of the flow: which form the interactions between particles take. It is chosen once a run.

use super::config::{DensityMethod, Discretization, SphConfig};
use super::dcpse::DcpseFlow;
use super::flow_state::{FlowState, Rates};
use super::pair_workspace::PairWorkspace;
use super::volume_form::Forms;
use super::walls::Walls;
use super::{mass_form, volume_form};
use crate::geometry::{Domain, Vector};
use crate::parallel::{Interrupt, Interrupted};

/// The form of the equations.
pub(super) enum FlowEquations<const D: usize> {
    /// Densities by summation, forces in the volume form.
    VolumeForm { forms: Forms },
    /// Densities by continuity with a diffusion ξ̂, forces in the mass form.
    MassForm { diffusion: f64 },
    /// Derivatives by fits, densities by continuity with a diffusion ξ̂ ε.
    Fits { fits: Box<DcpseFlow<D>>, spread: f64 },
}

impl<const D: usize> FlowEquations<D> {
    pub fn new(config: &SphConfig<D>, domain: &Domain<D>, count: usize) -> Self {
        let diffusion = match config.density {
            DensityMethod::Summation => None,
            DensityMethod::Continuity { diffusion } => Some(diffusion),
        };
        match (config.discretization, diffusion) {
            (Discretization::Dcpse(support), diffusion) => Self::Fits {
                fits: Box::new(DcpseFlow::new(support, domain.clone(), count)),
                spread: diffusion.unwrap_or(0.0) * config.smoothing_length,
            },
            (Discretization::Kernels, Some(diffusion)) => Self::MassForm { diffusion },
            (Discretization::Kernels, None) => Self::VolumeForm {
                forms: Forms {
                    pressure: config.pressure.form,
                    has_whole_stress: config.has_whole_stress(),
                    mean_shear: config.mean_shear,
                },
            },
        }
    }

    /// The fits, where derivatives are found by fits.
    pub fn fits(&self) -> Option<&DcpseFlow<D>> {
        match self {
            Self::Fits { fits, .. } => Some(fits),
            Self::VolumeForm { .. } | Self::MassForm { .. } => None,
        }
    }

    /// The fits, where derivatives are found by fits.
    pub fn fits_mut(&mut self) -> Option<&mut DcpseFlow<D>> {
        match self {
            Self::Fits { fits, .. } => Some(fits),
            Self::VolumeForm { .. } | Self::MassForm { .. } => None,
        }
    }

    /// Sets accelerations, and rates of integrated densities, to those of the interactions between particles. Walls go with the
    /// volume form alone.
    pub fn find_rates(
        &mut self,
        positions: &[Vector<D>],
        (flow, walls): (&FlowState<D>, Option<&mut Walls<D>>),
        pairs: &mut PairWorkspace<D>,
        rates: &mut Rates<D>,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        match self {
            Self::VolumeForm { forms } => {
                rates.pair_virial = volume_form::accelerate(flow, walls, *forms, pairs, &mut rates.acceleration)?;
                Ok(())
            }
            Self::MassForm { diffusion } => mass_form::find_rates(flow, *diffusion, pairs, rates),
            Self::Fits { fits, spread } => fits.find_rates(positions, flow, *spread, rates, interrupt),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{DensityMethod, Discretization, FlowEquations, Forms, SphConfig};
    use crate::operators::Support;
    use crate::schemes::weakly_compressible_sph::KernelChoice;
    use crate::schemes::weakly_compressible_sph::PressureForm;
    use crate::schemes::weakly_compressible_sph::test_setting::setting;

    #[test]
    fn the_equations_follow_from_discretization_and_density_method() {
        let config = setting::<2>(KernelChoice::WendlandC2, 1.0).config;
        let this = setting::<2>(KernelChoice::WendlandC2, 1.0);
        let equations = |config: &SphConfig<2>| FlowEquations::new(config, &this.domain, 4);
        let forms = |config: &SphConfig<2>| match equations(config) {
            FlowEquations::VolumeForm { forms } => forms,
            _ => panic!("no volume form"),
        };
        assert_eq!(forms(&config), Forms { pressure: PressureForm::Mean, has_whole_stress: false, mean_shear: None });
        let mut unequal = config.clone();
        unequal.pressure.form = PressureForm::Hamiltonian;
        unequal.fluids.inside.viscosity *= 2.0;
        assert!(forms(&unequal).has_whole_stress);
        unequal.starts_in_layers = true;
        assert!(!forms(&unequal).has_whole_stress);
        let mass = SphConfig { density: DensityMethod::Continuity { diffusion: 0.1 }, ..config };
        assert!(matches!(equations(&mass), FlowEquations::MassForm { diffusion: 0.1 }));
        let discretization = Discretization::Dcpse(Support { degree: 3, radius: 0.35 });
        let fits = SphConfig { discretization, ..mass };
        let FlowEquations::Fits { spread, .. } = equations(&fits) else { panic!("no fits") };
        assert!((spread - 0.1 * fits.smoothing_length).abs() < 1e-15);
    }
}

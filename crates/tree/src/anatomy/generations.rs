//! The branches of each generation together.
//!
//! **Input** measured branches. **Output** one summary for each generation from 0 on. **Cost** O(branches).

use espalier_model::BranchMeasures;
use espalier_model::anatomy::{GenerationSummary, Spread};

pub(super) fn summarise(branches: &[BranchMeasures]) -> Vec<GenerationSummary> {
    let mut by_generation: Vec<Vec<&BranchMeasures>> = Vec::new();
    for branch in branches {
        let generation = branch.generation as usize;
        if by_generation.len() <= generation {
            by_generation.resize(generation + 1, Vec::new());
        }
        by_generation[generation].push(branch);
    }
    by_generation.iter().zip(0..).map(|(members, generation)| summary(generation, members)).collect()
}

fn summary(generation: u32, members: &[&BranchMeasures]) -> GenerationSummary {
    let spread = |of: fn(&BranchMeasures) -> f64| spread(members.iter().map(|branch| of(branch)));
    GenerationSummary {
        generation,
        n_branches: members.len(),
        n_terminal: members.iter().filter(|branch| branch.children.is_empty()).count(),
        total_length_mm: members.iter().map(|branch| branch.length_mm).sum(),
        total_volume_mm3: members.iter().map(|branch| branch.volume_mm3).sum(),
        length_mm: spread(|branch| branch.length_mm),
        radius_mm: spread(|branch| branch.radius_mean_mm),
        tortuosity: spread(BranchMeasures::tortuosity),
        branching_angle_deg: spread(|branch| branch.branching_angle_deg),
    }
}

/// Mean and sample standard deviation of the values that are there.
fn spread(values: impl Iterator<Item = f64>) -> Spread {
    let known: Vec<f64> = values.filter(|value| !value.is_nan()).collect();
    let n = known.len() as f64;
    let mean = if n > 0.0 { known.iter().sum::<f64>() / n } else { f64::NAN };
    let squares: f64 = known.iter().map(|value| (value - mean) * (value - mean)).sum();
    Spread { mean, sd: if n > 1.0 { (squares / (n - 1.0)).sqrt() } else { f64::NAN } }
}

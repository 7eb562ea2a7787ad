//! Every scene that comes with the program, small: no ray is lost, and every pixel is a colour.

use super::{Case, Family, PICTURES, Reading};
use crate::{
    render::Shot,
    scene::{file, shipped},
    shader_io::COUNT_LOST,
};

const SIZE: [u32; 2] = [32, 24];

pub(super) fn cases() -> Vec<Case> {
    let family = Family { name: "scene", quantity: "rays lost, and pixels that are no colour", on: PICTURES };
    let case = |name: &'static str| {
        family.case(name, "small", move |bench, on| {
            let key = format!("scene {name}");
            let shot = |scene: &crate::scene::Scene| Shot::symmetric(scene.observer.frame, scene.observer.fov, SIZE);
            let (target, stats) = bench.draw(on, &key, || Ok(file::load(name)?), shot)?;
            let colourless = target.pixels.iter().filter(|p| !p.iter().all(|x| x.is_finite() && *x >= 0.0)).count();
            Ok(Reading::new(colourless as f64 + stats.counts[COUNT_LOST as usize] as f64, 0.0))
        })
    };
    shipped::names().map(case).collect()
}

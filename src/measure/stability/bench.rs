//! What cases run on: the devices, and what was made for them so far.

use super::On;
use crate::{
    geometry::GeometryId,
    render::{
        Backend, RenderError, Shot, Stats, Target,
        compute::{ComputeBackend, probe::Probe, walker::Walker},
        cpu::CpuBackend,
        plan::Plan,
        rt::RtBackend,
        world::World,
    },
    scene::Scene,
    shader_io::{ProbeIn, ProbeOut, Walk},
    space::{domain::Domain, reduce::TransportError},
    vulkan::{Context, ContextOptions, Tier, VulkanError},
};
use std::{collections::HashMap, sync::Arc};

/// Why a case could not be run: it then fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trouble(pub String);

macro_rules! troubles {
    ($($error:ty),*) => {$(
        impl From<$error> for Trouble {
            fn from(error: $error) -> Self {
                Self(error.to_string())
            }
        }
    )*};
}
troubles!(VulkanError, RenderError, TransportError, crate::scene::file::SceneError, crate::render::world::WorldError);

/// The backends that are there, and what they have loaded.
#[derive(Default)]
pub struct Bench {
    cpu: Option<Pictures>,
    compute: Option<(Arc<Context>, Pictures)>,
    rt: Option<Pictures>,
    probes: HashMap<GeometryId, Probe>,
    walker: Option<(String, Walker)>,
    /// Backends that were wanted and are not there, with the reason.
    pub missing: Vec<(On, String)>,
}

/// A backend with the scene that it has loaded, by the scene's key.
struct Pictures {
    backend: Box<dyn Backend>,
    loaded: Option<(String, Arc<World>)>,
}

impl Pictures {
    fn new(backend: impl Backend + 'static) -> Self {
        Self { backend: Box::new(backend), loaded: None }
    }
}

impl Bench {
    /// The backends in `wanted` that this machine has.
    ///
    /// # Errors
    /// What the environment says of a device is wrong, or a device fails.
    pub fn new(wanted: &[On]) -> Result<Self, VulkanError> {
        let mut bench = Self::default();
        for &on in wanted {
            let tier = match on {
                On::Cpu | On::CpuSingle => {
                    bench.cpu = Some(Pictures::new(CpuBackend::default()));
                    continue;
                }
                On::Compute => Tier::Compute,
                On::Rt => Tier::Rt,
            };
            match Context::new(&ContextOptions { tier, ..ContextOptions::from_env()? }) {
                Ok(context) => bench.add(on, &context)?,
                Err(
                    reason @ (VulkanError::NoLoader(_)
                    | VulkanError::OldLoader(_)
                    | VulkanError::NoDevice
                    | VulkanError::Lacking { .. }),
                ) => bench.missing.push((on, reason.to_string())),
                Err(failure) => return Err(failure),
            }
        }
        Ok(bench)
    }

    /// Takes a device in for a backend.
    ///
    /// # Errors
    /// Driver failures.
    pub fn add(&mut self, on: On, context: &Arc<Context>) -> Result<(), VulkanError> {
        match on {
            On::Cpu | On::CpuSingle => self.cpu = Some(Pictures::new(CpuBackend::default())),
            On::Compute => self.compute = Some((context.clone(), Pictures::new(ComputeBackend::new(context)?))),
            On::Rt => self.rt = Some(Pictures::new(RtBackend::new(context)?)),
        }
        Ok(())
    }

    /// Whether a backend is there.
    pub fn has(&self, on: On) -> bool {
        match on {
            On::Cpu | On::CpuSingle => self.cpu.is_some(),
            On::Compute => self.compute.is_some(),
            On::Rt => self.rt.is_some(),
        }
    }

    /// The backends that are there and draw, with their devices.
    pub fn devices(&self) -> Vec<(On, String)> {
        let pictures = |on| match on {
            On::Cpu => self.cpu.as_ref(),
            On::CpuSingle => None,
            On::Compute => self.compute.as_ref().map(|(_, pictures)| pictures),
            On::Rt => self.rt.as_ref(),
        };
        On::ALL.into_iter().filter_map(|on| Some((on, pictures(on)?.backend.device()))).collect()
    }

    fn context(&self) -> Result<&Arc<Context>, Trouble> {
        self.compute.as_ref().map(|(context, _)| context).ok_or_else(|| Trouble(String::from("no device")))
    }

    /// Evaluates functions of a geometry on the device.
    pub(super) fn probe(&mut self, geometry: GeometryId, inputs: &[ProbeIn]) -> Result<Vec<ProbeOut>, Trouble> {
        if !self.probes.contains_key(&geometry) {
            let probe = Probe::new(self.context()?, geometry)?;
            self.probes.insert(geometry, probe);
        }
        match self.probes.get_mut(&geometry) {
            Some(probe) => Ok(probe.run(inputs)?),
            None => Ok(Vec::new()),
        }
    }

    /// Walks rays through a space on the device; the walker of the space before goes.
    pub(super) fn walk(
        &mut self,
        key: &str,
        geometry: GeometryId,
        domain: &Domain,
        walks: &mut [Walk],
        record: usize,
    ) -> Result<Vec<Vec<u32>>, Trouble> {
        let key = format!("{key} {}", domain.labels.len());
        if self.walker.as_ref().is_none_or(|(known, _)| *known != key) {
            self.walker = None;
            self.walker = Some((key, Walker::new(self.context()?, geometry, domain, super::walk::TOLERANCE)?));
        }
        match &mut self.walker {
            Some((_, walker)) => Ok(walker.run(walks, record)?),
            None => Ok(Vec::new()),
        }
    }

    /// Draws a scene; `key` names it, so that pictures of one scene load it once.
    pub(super) fn draw(
        &mut self,
        on: On,
        key: &str,
        scene: impl FnOnce() -> Result<Scene, Trouble>,
        shot: impl Fn(&Scene) -> Shot,
    ) -> Result<(Target, Stats), Trouble> {
        let scene = scene()?;
        let pictures = match on {
            On::Cpu => self.cpu.as_mut(),
            On::CpuSingle => None,
            On::Compute => self.compute.as_mut().map(|(_, pictures)| pictures),
            On::Rt => self.rt.as_mut(),
        };
        let pictures = pictures.ok_or_else(|| Trouble(format!("no backend {}", on.name())))?;
        if pictures.loaded.as_ref().is_none_or(|(known, _)| known != key) {
            pictures.loaded = None;
            let plan = Plan::new(&scene, true);
            let world = Arc::new(World::new(&scene, &plan, scene.observer.frame)?);
            pictures.backend.load(&world)?;
            pictures.loaded = Some((key.to_owned(), world));
        }
        let shot = shot(&scene);
        let mut target = Target::new(shot.size);
        let stats = pictures.backend.render(&shot, &mut target, &|_| ())?;
        Ok((target, stats))
    }
}

//! A headset: the runtime, its session, and the [`Runtime`] that the loop of frames sees.

use super::{
    actions::{Actions, known},
    device::RuntimeCreator,
    error::XrError,
    frames::{Event, EyePose, FrameTime, Look, Runtime},
    lifecycle::SessionState,
    swapchain::{EyeImages, ImageOptions, color_format, depth_format},
    watchdog::Watchdog,
};
use crate::{
    render::device::eyes::{DepthScale, Encoding, Surfaces},
    space::body::RoomPose,
    vulkan::{Context, ContextOptions, VulkanError, image::Aspect},
};
use glam::{DQuat, DVec3};
use openxr::{
    ApplicationInfo, Entry, EnvironmentBlendMode, EventDataBuffer, ExtensionSet, FormFactor, FrameStream, FrameWaiter,
    Instance, Posef, ReferenceSpaceType, Session, Space, SystemId, Time, ViewConfigurationType, ViewStateFlags,
    VisibilityMaskTypeKHR, Vulkan, sys,
};
use std::{
    ptr,
    rc::Rc,
    sync::Arc,
    time::{Duration, Instant},
};

const STEREO: ViewConfigurationType = ViewConfigurationType::PRIMARY_STEREO;

/// A near plane for depths, in metres: nearer than hands are held.
const NEAR: f64 = 0.05;

/// The error of a call.
pub(super) fn failed(call: &'static str, result: sys::Result) -> XrError {
    match result {
        sys::Result::ERROR_SESSION_LOST => XrError::SessionLost { frames: 0 },
        // A runtime that has died says one of these two.
        sys::Result::ERROR_INSTANCE_LOST | sys::Result::ERROR_RUNTIME_FAILURE => {
            XrError::RuntimeGone { frames: 0, call }
        }
        result => XrError::Call { call, result: result.to_string() },
    }
}

/// A pose in 64 bits.
pub(super) fn room_pose(pose: Posef) -> RoomPose {
    let (p, q) = (pose.position, pose.orientation);
    RoomPose {
        position: DVec3::new(p.x.into(), p.y.into(), p.z.into()),
        rotation: DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into()),
    }
}

/// The same pose, which came from 32 bits.
fn raw_pose(pose: &RoomPose) -> Posef {
    let (p, q) = (pose.position.as_vec3(), pose.rotation.as_quat());
    Posef {
        position: openxr::Vector3f { x: p.x, y: p.y, z: p.z },
        orientation: openxr::Quaternionf { x: q.x, y: q.y, z: q.z, w: q.w },
    }
}

/// A runtime with a headset.
pub struct Headset {
    instance: Instance,
    system: SystemId,
    /// Name and version of the runtime.
    pub runtime: String,
    /// Name of the headset.
    pub name: String,
    /// Recommended width and height of an eye, and the largest.
    pub sizes: [[u32; 2]; 2],
    blend: EnvironmentBlendMode,
    hand_tracking: bool,
    watchdog: Rc<Watchdog>,
}

/// The loader of the machine, without an instance.
pub(super) fn entry() -> Result<Entry, XrError> {
    // SAFETY: loading runs the initialisers of the library that the system names libopenxr_loader, which conforms to
    // the OpenXR specification; it is loaded only where somebody asks for it.
    unsafe { Entry::load(&()) }.map_err(|_| XrError::NoLoader(String::from("no loader on this machine")))
}

/// An instance of the machine's runtime with some extensions.
pub(super) fn instance(entry: &Entry, extensions: &ExtensionSet) -> Result<Instance, XrError> {
    let application = ApplicationInfo {
        application_name: "holonomy",
        application_version: 1,
        engine_name: "holonomy",
        engine_version: 1,
        api_version: openxr::Version::new(1, 0, 0),
    };
    entry
        .create_instance(&application, extensions, &[], &())
        .map_err(|result| XrError::NoRuntime(format!("none answers ({result})")))
}

impl Headset {
    /// Finds the machine's runtime and its headset.
    ///
    /// # Errors
    /// There is none, or it cannot do what is needed.
    pub fn find(watchdog: Rc<Watchdog>) -> Result<Self, XrError> {
        let entry = watchdog.watch("loading OpenXR", entry)?;
        let offered = watchdog.watch("xrEnumerateInstanceExtensionProperties", || entry.enumerate_extensions());
        let offered = offered.map_err(|result| XrError::NoRuntime(format!("none is installed ({result})")))?;
        let mut wanted = ExtensionSet::default();
        wanted.khr_vulkan_enable2 = offered.khr_vulkan_enable2;
        wanted.khr_composition_layer_depth = offered.khr_composition_layer_depth;
        wanted.khr_visibility_mask = offered.khr_visibility_mask;
        wanted.ext_hand_tracking = offered.ext_hand_tracking;
        let instance = watchdog.watch("xrCreateInstance", || instance(&entry, &wanted))?;
        let properties = instance.properties().map_err(|r| failed("xrGetInstanceProperties", r))?;
        let runtime = format!("{} {}", properties.runtime_name, properties.runtime_version);
        if !offered.khr_vulkan_enable2 {
            return Err(XrError::Lacks { runtime, lacking: String::from("XR_KHR_vulkan_enable2") });
        }
        let system = match watchdog.watch("xrGetSystem", || instance.system(FormFactor::HEAD_MOUNTED_DISPLAY)) {
            Ok(system) => system,
            Err(sys::Result::ERROR_FORM_FACTOR_UNAVAILABLE | sys::Result::ERROR_FORM_FACTOR_UNSUPPORTED) => {
                return Err(XrError::NoHeadset(runtime));
            }
            Err(result) => return Err(failed("xrGetSystem", result)),
        };
        let name = instance.system_properties(system).map_err(|r| failed("xrGetSystemProperties", r))?.system_name;
        let views = instance
            .enumerate_view_configuration_views(system, STEREO)
            .map_err(|r| failed("xrEnumerateViewConfigurationViews", r))?;
        let [left, right] = views.as_slice() else {
            return Err(XrError::Lacks { runtime, lacking: String::from("two views") });
        };
        // One size for both, so that they are layers of one image.
        let larger = |side: fn(&openxr::ViewConfigurationView) -> u32| side(left).max(side(right));
        let smaller = |side: fn(&openxr::ViewConfigurationView) -> u32| side(left).min(side(right));
        let sizes = [
            [larger(|v| v.recommended_image_rect_width), larger(|v| v.recommended_image_rect_height)],
            [smaller(|v| v.max_image_rect_width), smaller(|v| v.max_image_rect_height)],
        ];
        let blends = instance
            .enumerate_environment_blend_modes(system, STEREO)
            .map_err(|r| failed("xrEnumerateEnvironmentBlendModes", r))?;
        let Some(blend) = blends.first().copied() else {
            return Err(XrError::Lacks { runtime, lacking: String::from("a blend mode") });
        };
        // Closed spaces fill the view: opaque wherever the headset can.
        let blend = if blends.contains(&EnvironmentBlendMode::OPAQUE) { EnvironmentBlendMode::OPAQUE } else { blend };
        let hand_tracking = offered.ext_hand_tracking && instance.supports_hand_tracking(system).unwrap_or(false);
        Ok(Self { instance, system, runtime, name, sizes, blend, hand_tracking, watchdog })
    }

    /// Opens the device that the headset hangs on.
    ///
    /// # Errors
    /// The runtime's and the driver's; a device that lacks what the options want.
    pub fn context(&self, options: &ContextOptions) -> Result<Arc<Context>, VulkanError> {
        self.watchdog.watch("xrCreateVulkanDeviceKHR", || {
            // To be asked before a session is made; the version that is used, 1.2, is one that all runtimes take.
            let _ = self.instance.graphics_requirements::<Vulkan>(self.system);
            Context::with_creator(options, &mut RuntimeCreator::new(&self.instance, self.system))
        })
    }

    /// Starts a session on the device.
    ///
    /// # Errors
    /// The runtime's.
    pub fn session(&self, context: &Arc<Context>, options: &SessionOptions) -> Result<HeadsetSession, XrError> {
        HeadsetSession::new(self, context, options)
    }
}

/// How a session shall be.
#[derive(Clone, Copy, Debug)]
pub struct SessionOptions {
    /// Width and height of the images of an eye.
    pub size: [u32; 2],
    /// Metres in a unit of length, for depths.
    pub unit_in_metres: f64,
    /// Whether images will be read back.
    pub read: bool,
}

/// A session with a headset.
pub struct HeadsetSession {
    // In the order in which they have to go.
    colors: EyeImages,
    depths: Option<EyeImages>,
    actions: Actions,
    view: Space,
    room: Space,
    stream: FrameStream<Vulkan>,
    waiter: FrameWaiter,
    session: Session<Vulkan>,
    instance: Instance,
    /// How colours are stored.
    pub encoding: Encoding,
    /// Depths that are handed in, if the runtime takes them.
    pub depth: Option<DepthScale>,
    blend: EnvironmentBlendMode,
    masks: bool,
    events: EventDataBuffer,
    start: Instant,
    watchdog: Rc<Watchdog>,
    /// The session uses the device until it goes.
    _context: Arc<Context>,
}

impl HeadsetSession {
    fn new(headset: &Headset, context: &Arc<Context>, options: &SessionOptions) -> Result<Self, XrError> {
        use ash::vk::Handle;
        let (instance, watchdog) = (headset.instance.clone(), headset.watchdog.clone());
        let binding = openxr::vulkan::SessionCreateInfo {
            instance: context.instance().raw().handle().as_raw() as *const _,
            physical_device: context.physical_device().as_raw() as *const _,
            device: context.raw().handle().as_raw() as *const _,
            queue_family_index: context.queue_family(),
            queue_index: 0,
        };
        let made = watchdog.watch("xrCreateSession", || {
            // SAFETY: the handles are alive, made by this runtime, and outlive the session, which holds the context.
            unsafe { instance.create_session::<Vulkan>(headset.system, &binding) }
        });
        let (session, waiter, stream) = made.map_err(|r| failed("xrCreateSession", r))?;
        watchdog.watch("making a session", || {
            let space = |kind| {
                session.create_reference_space(kind, Posef::IDENTITY).map_err(|r| failed("xrCreateReferenceSpace", r))
            };
            let (room, view) = (space(ReferenceSpaceType::LOCAL)?, space(ReferenceSpaceType::VIEW)?);
            let offered =
                session.enumerate_swapchain_formats().map_err(|r| failed("xrEnumerateSwapchainFormats", r))?;
            let Some((format, encoding)) = color_format(&offered) else {
                let lacking = String::from("a colour format of 8 or 16 bits");
                return Err(XrError::Lacks { runtime: headset.runtime.clone(), lacking });
            };
            let images = |format, pixel_bytes, aspect, read| {
                EyeImages::new(
                    &session,
                    context,
                    ImageOptions { format, pixel_bytes, aspect, size: options.size, read },
                )
            };
            let colors = images(format, encoding.bytes(), Aspect::Color, options.read)?;
            // Depths are a help for the runtime, not a need: without a fitting format there are none.
            let wanted = instance.exts().khr_composition_layer_depth.is_some();
            let depth_format = depth_format(&offered).filter(|_| wanted);
            let depths = depth_format.and_then(|format| images(format, 4, Aspect::Depth, false).ok());
            let depth = depths.as_ref().map(|_| DepthScale { unit_in_metres: options.unit_in_metres, near: NEAR });
            let actions = Actions::new(&instance, &session, headset.hand_tracking)?;
            Ok(Self {
                colors,
                depths,
                actions,
                view,
                room,
                stream,
                waiter,
                masks: instance.exts().khr_visibility_mask.is_some(),
                encoding,
                depth,
                blend: headset.blend,
                events: EventDataBuffer::new(),
                start: Instant::now(),
                watchdog: watchdog.clone(),
                _context: context.clone(),
                session: session.clone(),
                instance: instance.clone(),
            })
        })
    }

    fn hidden_from(&self, eye: u32) -> Vec<[[f64; 2]; 3]> {
        if !self.masks {
            return Vec::new();
        }
        let kind = VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH;
        let mask =
            self.watchdog.watch("xrGetVisibilityMaskKHR", || self.session.get_visibility_mask_khr(STEREO, eye, kind));
        // All is seen where the runtime does not say what is hidden.
        let Ok(mask) = mask else { return Vec::new() };
        let corner = |index: &u32| mask.vertices.get(*index as usize).map(|v| [f64::from(v.x), f64::from(v.y)]);
        let triangle = |corners: &[u32]| match corners {
            [a, b, c] => Some([corner(a)?, corner(b)?, corner(c)?]),
            _ => None,
        };
        mask.indices.chunks(3).filter_map(triangle).collect()
    }

    fn located(&self, time: Time, focused: bool) -> Result<Option<Look>, XrError> {
        let mut buttons = self.actions.buttons(&self.session, focused)?;
        let hands = self.actions.hands(&self.session, &self.room, time, &mut buttons)?;
        let head = self.view.locate(&self.room, time).map_err(|r| failed("xrLocateSpace", r))?;
        // The eyes last: the less time passes until they are drawn, the better.
        let (flags, views) =
            self.session.locate_views(STEREO, time, &self.room).map_err(|r| failed("xrLocateViews", r))?;
        let [left, right] = views.as_slice() else { return Ok(None) };
        let valid = ViewStateFlags::POSITION_VALID | ViewStateFlags::ORIENTATION_VALID;
        if !flags.contains(valid) || !known(head.location_flags) {
            return Ok(None);
        }
        let eye = |view: &openxr::View| EyePose {
            pose: room_pose(view.pose),
            angles: [view.fov.angle_left, view.fov.angle_right, view.fov.angle_down, view.fov.angle_up].map(f64::from),
        };
        Ok(Some(Look { eyes: [eye(left), eye(right)], head: room_pose(head.pose), hands, buttons }))
    }
}

impl Runtime for HeadsetSession {
    fn poll(&mut self) -> Result<Option<Event>, XrError> {
        let polled = self.watchdog.watch("xrPollEvent", || self.instance.poll_event(&mut self.events));
        let event = polled.map_err(|r| failed("xrPollEvent", r))?;
        Ok(event.map(|event| match event {
            openxr::Event::SessionStateChanged(change) => {
                use openxr::SessionState as S;
                match change.state() {
                    S::IDLE => Event::State(SessionState::Idle),
                    S::READY => Event::State(SessionState::Ready),
                    S::SYNCHRONIZED => Event::State(SessionState::Synchronized),
                    S::VISIBLE => Event::State(SessionState::Visible),
                    S::FOCUSED => Event::State(SessionState::Focused),
                    S::STOPPING => Event::State(SessionState::Stopping),
                    S::LOSS_PENDING => Event::State(SessionState::LossPending),
                    S::EXITING => Event::State(SessionState::Exiting),
                    _ => Event::Other,
                }
            }
            openxr::Event::InstanceLossPending(_) => Event::InstanceLoss,
            openxr::Event::VisibilityMaskChangedKHR(_) => Event::Mask,
            _ => Event::Other,
        }))
    }

    fn begin_session(&mut self) -> Result<(), XrError> {
        let begun = self.watchdog.watch("xrBeginSession", || self.session.begin(STEREO));
        begun.map(|_| ()).map_err(|r| failed("xrBeginSession", r))
    }

    fn end_session(&mut self) -> Result<(), XrError> {
        let ended = self.watchdog.watch("xrEndSession", || self.session.end());
        ended.map(|_| ()).map_err(|r| failed("xrEndSession", r))
    }

    fn request_exit(&mut self) -> Result<(), XrError> {
        let asked = self.watchdog.watch("xrRequestExitSession", || self.session.request_exit());
        asked.map_err(|r| failed("xrRequestExitSession", r))
    }

    fn wait_frame(&mut self) -> Result<FrameTime, XrError> {
        let waited = self.watchdog.watch("xrWaitFrame", || self.waiter.wait());
        let state = waited.map_err(|r| failed("xrWaitFrame", r))?;
        Ok(FrameTime {
            display: state.predicted_display_time.as_nanos(),
            period: state.predicted_display_period.as_nanos(),
            should_render: state.should_render,
        })
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        let begun = self.watchdog.watch("xrBeginFrame", || self.stream.begin());
        begun.map_err(|r| failed("xrBeginFrame", r))
    }

    fn acquire(&mut self) -> Result<(), XrError> {
        let Self { colors, depths, watchdog, .. } = self;
        watchdog.watch("xrWaitSwapchainImage", || {
            colors.acquire()?;
            depths.as_mut().map_or(Ok(()), EyeImages::acquire)
        })
    }

    fn surfaces(&self) -> Option<Surfaces<'_>> {
        let depth = match &self.depths {
            Some(depths) => Some(depths.surfaces()?),
            None => None,
        };
        Some(Surfaces { color: self.colors.surfaces()?, depth })
    }

    fn release(&mut self) -> Result<(), XrError> {
        let Self { colors, depths, watchdog, .. } = self;
        watchdog.watch("xrReleaseSwapchainImage", || {
            colors.release()?;
            depths.as_mut().map_or(Ok(()), EyeImages::release)
        })
    }

    fn look(&mut self, time: FrameTime, focused: bool) -> Result<Option<Look>, XrError> {
        self.watchdog.watch("xrLocateViews", || self.located(Time::from_nanos(time.display), focused))
    }

    fn end_frame(&mut self, time: FrameTime, drawn: Option<(&Look, [u32; 2])>) -> Result<(), XrError> {
        let depth_info = |eye: usize, size| {
            self.depths.as_ref().map(|depths| sys::CompositionLayerDepthInfoKHR {
                ty: sys::CompositionLayerDepthInfoKHR::TYPE,
                next: ptr::null(),
                sub_image: depths.sub_image(eye, size),
                min_depth: 0.0,
                max_depth: 1.0,
                near_z: NEAR as f32,
                far_z: f32::INFINITY,
            })
        };
        let size = drawn.map_or([0; 2], |(_, size)| size);
        let depth_infos = [depth_info(0, size), depth_info(1, size)];
        let views = drawn.map(|(look, size)| {
            [0, 1].map(|eye| {
                let EyePose { pose, angles } = &look.eyes[eye];
                let [left, right, down, up] = angles.map(|a| a as f32);
                sys::CompositionLayerProjectionView {
                    ty: sys::CompositionLayerProjectionView::TYPE,
                    next: depth_infos[eye].as_ref().map_or(ptr::null(), |info| ptr::from_ref(info).cast()),
                    pose: raw_pose(pose),
                    fov: openxr::Fovf { angle_left: left, angle_right: right, angle_up: up, angle_down: down },
                    sub_image: self.colors.sub_image(eye, size),
                }
            })
        });
        let layer = views.as_ref().map(|views| sys::CompositionLayerProjection {
            ty: sys::CompositionLayerProjection::TYPE,
            next: ptr::null(),
            layer_flags: sys::CompositionLayerFlags::EMPTY,
            space: self.room.as_raw(),
            view_count: 2,
            views: views.as_ptr(),
        });
        let layers: Vec<*const sys::CompositionLayerBaseHeader> =
            layer.iter().map(|layer| ptr::from_ref(layer).cast()).collect();
        let info = sys::FrameEndInfo {
            ty: sys::FrameEndInfo::TYPE,
            next: ptr::null(),
            display_time: Time::from_nanos(time.display),
            environment_blend_mode: self.blend,
            layer_count: layers.len() as u32,
            layers: layers.as_ptr(),
        };
        let result = self.watchdog.watch("xrEndFrame", || {
            // SAFETY: the session is alive and a frame has been begun; the structures and those that they point to live
            // until the call is over.
            unsafe { (self.instance.fp().end_frame)(self.session.as_raw(), &info) }
        });
        if result.into_raw() < 0 { Err(failed("xrEndFrame", result)) } else { Ok(()) }
    }

    fn hidden(&mut self) -> [Vec<[[f64; 2]; 3]>; 2] {
        [self.hidden_from(0), self.hidden_from(1)]
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn pause(&mut self, time: Duration) {
        std::thread::sleep(time);
    }
}

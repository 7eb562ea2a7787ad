//! A body for somebody with a headset: hands where his hands are, and a head that he sees in the copies of his cell.
//!
//! The head hangs behind the eyes, all of it: no eye looks backwards, so nobody sees his own head from inside, and the copies
//! of it are seen from all sides.

use super::{Hand, Object, Place, Scene, Shape, folder::Folder, gltf};
use glam::{DMat3, DVec3};

/// Metres to which a unit of the head's mesh is drawn: it is 1.8 wide.
const HEAD_SCALE: f64 = 0.12;

/// Metres from the eyes to the middle of the head: half its depth, and the thickness of the hair.
const HEAD_BACK: f64 = 0.11;

/// Metres to which a unit of a hand's mesh is drawn: it is 1.9 long.
const HAND_SCALE: f64 = 0.1;

const HANDS: [(&str, Hand, f64); 2] =
    // The grip's first axis leaves the palm of the left hand and enters that of the right (OpenXR 1.0, section 6.3.2); the
    // back of the meshes is up.
    [("meshes/left-hand.glb", Hand::Left, 90.0), ("meshes/right-hand.glb", Hand::Right, -90.0)];

const HEAD: &str = "meshes/head.glb";

/// Gives the viewer the parts of a body that the scene does not attach itself. Hands that it holds before the viewer move to
/// where the tracked hands are.
///
/// # Errors
/// A mesh that comes with the program cannot be read.
pub fn add(scene: &mut Scene, unit_in_metres: f64) -> Result<(), gltf::GltfError> {
    for (file, hand, roll) in HANDS {
        let rotation = DMat3::from_rotation_z(roll.to_radians());
        let place = Place::Hand { hand, offset: DVec3::ZERO, rotation };
        let held = scene.objects.iter_mut().filter(|object| {
            let Shape::Mesh(mesh) = object.shape else { return false };
            matches!(object.place, Place::Viewer { .. }) && scene.meshes[mesh].name == file
        });
        let mut moved = 0;
        for object in held {
            object.place = place;
            moved += 1;
        }
        let attached = |object: &Object| matches!(object.place, Place::Hand { hand: other, .. } if other == hand);
        if moved == 0 && !scene.objects.iter().any(attached) {
            push(scene, file, place, HAND_SCALE / unit_in_metres)?;
        }
    }
    if !scene.objects.iter().any(|object| matches!(object.place, Place::Viewer { .. })) {
        let offset = DVec3::Z * (HEAD_BACK / unit_in_metres);
        let rotation = DMat3::from_rotation_y(std::f64::consts::PI);
        push(scene, HEAD, Place::Viewer { offset, rotation }, HEAD_SCALE / unit_in_metres)?;
    }
    Ok(())
}

fn push(scene: &mut Scene, file: &str, place: Place, scale: f64) -> Result<(), gltf::GltfError> {
    let known = scene.meshes.iter().position(|mesh| mesh.name == file);
    let mesh = match known {
        Some(mesh) => mesh,
        None => {
            let loaded = gltf::read(&Folder::Embedded, file, scene.materials.len(), &scene.textures)?;
            scene.materials.extend(loaded.materials);
            scene.textures.extend(loaded.textures);
            scene.meshes.push(loaded.mesh);
            scene.meshes.len() - 1
        }
    };
    let name = format!("own {file}");
    scene.objects.push(Object { name, shape: Shape::Mesh(mesh), place, scale, material: None, motion: None });
    Ok(())
}

// main.js - begins the viewer.
import {Vector3} from 'three';
document.title = `rqt ${new Vector3().length()}`;
